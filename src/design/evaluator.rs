//! What one design does, at search fidelity, and its exact derivatives: the FE-backed evaluation of the search.
//!
//! Voxel sums are replaced by integrals over quadrature points (see [`crate::sensitivity`]), which vary smoothly with
//! the design, so that gradients are meaningful. The derivative of every number along a design variable follows from
//! one back-solve for the state, one for each material sensitivity, and a central difference of the integrals along the
//! known direction (X + tV, u + tu′, s + ts′): no solution is differenced.

use super::aim::ObjectiveKind;
use super::evaluation_failure::EvaluationFailure;
use super::material_samples::{MaterialSample, sample_materials};
use super::response::{Response, criteria_as_relative_sd, log_or_undetermined, normalised, tearing_stretch};
use super::shown::{Block, ImitatingMaterial, OnTheWay, Shown, Solved, sum_of_readings};
use super::space::{Subspace, Variable};
use super::study::{MaterialPrior, Study};
use super::tell_apart::{Imitation, log_separation, separation, state_of};
use crate::fem::{Change, Equilibrium, ForwardModel, ParameterSensitivity, QuadraturePoint, SolveOptions, Tangent};
use crate::kinematics::principal_stretches;
use crate::material::Material;
use crate::mesh::{MeshOptions, shape_velocity};
use crate::sensitivity::{
    ForceReading, ForceReadings, MaterialState, ScannedBlock, information_of_protocol, integrate_over_blocks,
};
use crate::specimen::{PRECOMPRESSION_DIRECTION, Specimen};
use serde::{Deserialize, Serialize};

/// A design's responses to each material of [`sample_materials`], and, where asked for, their derivatives.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Evaluated {
    /// One per material sample.
    pub responses: Vec<Response>,
    /// `[material sample][variable][entry of Response::to_vector]`; empty unless asked for.
    pub gradients: Vec<Vec<Vec<f64>>>,
}

/// Evaluates designs of a study at search fidelity.
pub struct Evaluator<'a> {
    study: &'a Study,
    samples: Vec<MaterialSample>,
    /// Factor on the search mesh's element size.
    coarseness: f64,
    solve: SolveOptions,
}

/// What a variable moves, per unit of it.
pub(super) struct Move {
    /// The nodes; `None`: not at all.
    velocity: Option<Vec<[f64; 3]>>,
    /// Whether it is the drive of the scan.
    is_drive: bool,
    /// The moved plate before the drive; `None`: not at all.
    plate: Option<[f64; 3]>,
}

impl Move {
    /// What it changes of an equilibrium at the drive of the scan.
    fn at_scan(&self, tangent: &Tangent) -> Change {
        match self.plate {
            Some(rate) => tangent.change_of_moved_plate(rate),
            None => tangent.change_of_nodes(self.velocity.as_deref(), if self.is_drive { 1.0 } else { 0.0 }),
        }
    }

    /// What it changes of an equilibrium at a drive before, which stays as the scan's drive moves; `None`: nothing.
    fn on_the_way(&self, tangent: &Tangent) -> Option<Change> {
        (!self.is_drive && (self.velocity.is_some() || self.plate.is_some())).then(|| self.at_scan(tangent))
    }
}

impl<'a> Evaluator<'a> {
    /// For `study`: at the priors' central values, and at their variants if its budget says so.
    pub fn new(study: &'a Study) -> Evaluator<'a> {
        if study.budget.variants_in_search {
            return Self::with_variants(study);
        }
        let central: Vec<MaterialPrior> =
            study.materials.iter().map(|prior| MaterialPrior { relative_sd: 0.0, ..prior.clone() }).collect();
        Evaluator { study, samples: sample_materials(&central), coarseness: 1.0, solve: SolveOptions::trial() }
    }

    /// For `study`, always at the variants too.
    pub fn with_variants(study: &'a Study) -> Evaluator<'a> {
        Evaluator { study, samples: sample_materials(&study.materials), coarseness: 1.0, solve: SolveOptions::trial() }
    }

    /// The same with elements larger by `factor`: for tests.
    pub fn with_coarseness(mut self, factor: f64) -> Self {
        self.coarseness = factor;
        self
    }

    /// The materials in the order of [`Evaluated::responses`].
    pub fn samples(&self) -> &[MaterialSample] {
        &self.samples
    }

    /// Mesh of a specimen at search fidelity.
    pub fn mesh_options(&self, specimen: &Specimen) -> MeshOptions {
        let options = MeshOptions::search(specimen);
        MeshOptions { section_size_mm: options.section_size_mm * self.coarseness, ..options }
    }

    /// Responses at the specimen's last drive; with gradients where `subspace` is given.
    ///
    /// # Errors
    /// [`EvaluationFailure`].
    pub fn evaluate(
        &self,
        specimen: &Specimen,
        subspace: Option<&Subspace>,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Evaluated, EvaluationFailure> {
        let no_drive = || EvaluationFailure::Geometry { reason: "the specimen has no drive".into() };
        let drive = *specimen.drive_mm.last().ok_or_else(no_drive)?;
        specimen.validate().map_err(|e| EvaluationFailure::Geometry { reason: e.to_string() })?;
        let samples = specimen.samples();
        let counts = specimen.num_scanned(self.study.protocol.blocks_scanned);
        let (mut blocks, mut solved, mut moves_of_blocks) = (Vec::new(), Vec::new(), Vec::new());
        for (number, (sample, num_scanned)) in samples.iter().zip(counts).enumerate() {
            let model = ForwardModel::of_specimen(sample, &self.mesh_options(sample))?;
            let mut block = Block { model, has_plates: sample.has_plates(), num_scanned };
            let moves: Vec<Move> = subspace
                .map(|s| s.variables.iter().map(|&v| a_move(&block.model, (sample, number), s, v)).collect())
                .unwrap_or_default();
            solved.push(self.solve(&mut block.model, drive, &moves, is_cancelled)?);
            blocks.push(block);
            moves_of_blocks.push(moves);
        }
        let shown: Vec<Shown> = blocks.iter().zip(&solved).map(|(b, s)| Shown::as_solved(b, s)).collect();
        let responses = self.responses(&shown)?;
        let mut gradients = Vec::new();
        if let Some(subspace) = subspace {
            gradients = vec![Vec::with_capacity(subspace.variables.len()); self.samples.len()];
            for index in 0..subspace.variables.len() {
                let rows = self.gradient(&blocks, &solved, index, &moves_of_blocks)?;
                gradients.iter_mut().zip(rows).for_each(|(all, row)| all.push(row));
            }
        }
        Ok(Evaluated { responses, gradients })
    }

    /// Every sample's state at `drive`, its derivatives along each of `moves`, and what earlier materials make of it.
    fn solve(
        &self,
        model: &mut ForwardModel,
        drive: f64,
        moves: &[Move],
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Solved, EvaluationFailure> {
        let mut solved =
            Solved { states: Vec::new(), on_the_way: Vec::new(), imitators: Vec::new(), paths: Vec::new() };
        let mut equilibria: Vec<Equilibrium> = Vec::new();
        let along_moves = |tangent: &mut Tangent, state: &MaterialState| {
            let along = |m: &Move| {
                let change = m.at_scan(tangent);
                tangent.path_sensitivity_of(&state.sensitivities, &change)
            };
            moves.iter().map(along).collect::<Result<Vec<_>, _>>()
        };
        for sample in &self.samples {
            let material = &sample.material;
            solved.on_the_way.push(self.on_the_way(model, material, drive, moves, is_cancelled)?);
            let found = match equilibria.last() {
                // A neighbouring material's state is closer than rest; where it is not, start over.
                Some(previous) => model
                    .solve(material, drive, Some(previous), &self.solve, is_cancelled)
                    .or_else(|_| model.solve(material, drive, None, &self.solve, is_cancelled))?,
                None => model.solve(material, drive, None, &self.solve, is_cancelled)?,
            };
            let mut tangent = model.tangent(material, &found)?;
            let state = state_of(&found, &mut tangent)?;
            solved.paths.push(along_moves(&mut tangent, &state)?);
            solved.states.push(state);
            equilibria.push(found);
        }
        if self.study.objective.kind == ObjectiveKind::TellApart {
            for of in 0..self.samples.len() {
                let earlier = (0..of).filter(|&o| self.is_central(o) && self.samples[o].prior < self.samples[of].prior);
                for other in earlier.collect::<Vec<_>>() {
                    let (start, material) = (&equilibria[other], &self.samples[other].material);
                    let theirs = &solved.states[of];
                    let imitation = Imitation {
                        study: self.study,
                        model: &mut *model,
                        theirs,
                        drive_mm: drive,
                        solve: &self.solve,
                        is_cancelled,
                    };
                    let fit = imitation.nearest(material, start)?;
                    let mut tangent = model.tangent(&fit.material, &fit.equilibrium)?;
                    solved.paths.push(along_moves(&mut tangent, &fit.state)?);
                    solved.imitators.push(ImitatingMaterial { of, material: fit.material, state: fit.state });
                }
            }
        }
        Ok(solved)
    }

    /// The forces that are read before `drive` with `material`, and their derivatives along each of `moves`.
    fn on_the_way(
        &self,
        model: &mut ForwardModel,
        material: &Material,
        drive: f64,
        moves: &[Move],
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<OnTheWay, EvaluationFailure> {
        let drives = self.study.protocol.on_the_way_to(drive).force_drives_mm();
        let mut found = OnTheWay { readings: Vec::new(), rates: vec![Vec::new(); moves.len()] };
        if drives.is_empty() {
            return Ok(found);
        }
        let forces = |s: &[ParameterSensitivity]| s.iter().map(|s| s.force_n).collect();
        for equilibrium in model.solve_path(material, &drives, &self.solve, is_cancelled)? {
            let mut tangent = model.tangent(material, &equilibrium)?;
            let sensitivities = tangent.material_sensitivities()?;
            for (rates, a_move) in found.rates.iter_mut().zip(moves) {
                rates.push(match a_move.on_the_way(&tangent) {
                    Some(change) => {
                        let along = tangent.path_sensitivity_of(&sensitivities, &change)?;
                        ForceReading { force_n: along.force_n, sensitivities: forces(&along.parameters) }
                    }
                    None => ForceReading { force_n: 0.0, sensitivities: vec![0.0; sensitivities.len()] },
                });
            }
            let force_n = equilibrium.force_n;
            found.readings.push(ForceReading { force_n, sensitivities: forces(&sensitivities) });
        }
        Ok(found)
    }

    /// Derivative of every sample's response entries along the move with this index, per mm. Fitted materials keep
    /// their values: at the nearest point the distance does not change with them.
    fn gradient(
        &self,
        blocks: &[Block],
        solved: &[Solved],
        index: usize,
        moves_of_blocks: &[Vec<Move>],
    ) -> Result<Vec<Vec<f64>>, EvaluationFailure> {
        // A central difference along a known direction: 10⁻⁴ mm balances its truncation and rounding.
        let t = 1e-4;
        let mut sides = Vec::with_capacity(2);
        for step in [t, -t] {
            let moved = blocks.iter().zip(solved).zip(moves_of_blocks).map(|((block, solved), moves)| {
                Shown::moved(block, solved, index, (moves[index].velocity.as_deref(), step))
            });
            sides.push(self.responses(&moved.collect::<Vec<_>>())?);
        }
        let slope = |(a, b): (&Response, &Response)| -> Vec<f64> {
            a.to_vector().iter().zip(b.to_vector()).map(|(a, b)| (a - b) / (2.0 * t)).collect()
        };
        Ok(sides[0].iter().zip(&sides[1]).map(slope).collect())
    }

    /// Responses of all material samples of a design with these kinds of samples.
    fn responses(&self, shown: &[Shown]) -> Result<Vec<Response>, EvaluationFailure> {
        let mut all = Vec::with_capacity(self.samples.len());
        for (index, sample) in self.samples.iter().enumerate() {
            let mut response = self.response(&sample.material, index, shown)?;
            let mut distances = Vec::new();
            // A study that tells materials apart has one kind of sample.
            for block in shown {
                let theirs = &block.states[index];
                for i in block.imitators.iter().filter(|i| i.of == index) {
                    let (model, positions) = (&block.block.model, &block.positions);
                    let apart = separation(self.study, model, positions, &i.material, &i.state, theirs)?;
                    distances.push(apart.distance_sd);
                }
            }
            response.log_separation = log_separation(distances);
            all.push(response);
        }
        Ok(all)
    }

    /// Whether a sample is its prior's central value, which comes first.
    fn is_central(&self, index: usize) -> bool {
        index == 0 || self.samples[index - 1].prior != self.samples[index].prior
    }

    /// Response to the material sample with this index.
    fn response(&self, material: &Material, index: usize, shown: &[Shown]) -> Result<Response, EvaluationFailure> {
        let scan = &self.study.scan;
        let voxel_volume = scan.voxel_mm.iter().product();
        let fields: Vec<Vec<QuadraturePoint>> = shown
            .iter()
            .map(|s| s.block.model.quadrature_fields_at(material, &s.positions, &s.states[index].displacement))
            .collect();
        let of_blocks = shown.iter().zip(&fields).map(|(s, points)| ScannedBlock {
            count: s.block.num_scanned,
            mesh: s.block.model.mesh(),
            points,
            sensitivities: &s.states[index].sensitivities,
        });
        let blocks: Vec<ScannedBlock> = of_blocks.collect();
        let readings = sum_of_readings(shown, index);
        let forces = ForceReadings { readings: &readings, protocol: &self.study.protocol };
        let information = information_of_protocol(material, &blocks, &forces, &scan.noise(), voxel_volume)?;
        let covariance = information.covariance();
        let shear = information.shear_indices();
        let normalisation = self.study.objective.normalisation;
        let integrated = integrate_over_blocks(material, &blocks, voxel_volume);
        let stretches = fields.iter().map(|points| {
            tearing_stretch(points.iter().map(|q| (principal_stretches(&q.deformation_gradient)[0], q.volume_mm3)))
        });
        let force_n: f64 = shown.iter().map(|s| s.states[index].force_n).sum();
        let with_plates = shown.iter().filter(|s| s.block.has_plates);
        Ok(Response {
            log_integrated: integrated.iter().map(|s| normalised(s, normalisation).max(1e-300).ln()).collect(),
            log_relative_sd: shear.iter().map(|&i| log_or_undetermined(covariance.relative_sd(i))).collect(),
            log_criteria: criteria_as_relative_sd(&covariance, &shear).map(log_or_undetermined),
            log_separation: 0.0,
            log_detectable: Vec::new(),
            log_force: force_n.abs().max(1e-12).ln(),
            normal_force_n: with_plates.map(|s| s.states[index].normal_force_n).sum(),
            log_stretch: stretches.fold(1.0, f64::max).ln(),
        })
    }
}

/// What `variable` moves of the design's sample with this number.
fn a_move(
    model: &ForwardModel,
    (specimen, number): (&Specimen, usize),
    subspace: &Subspace,
    variable: Variable,
) -> Move {
    let mut velocity: Option<Vec<[f64; 3]>> = None;
    for (design_variable, sign) in subspace.moves(variable, number) {
        let one = shape_velocity(model.mesh(), specimen, design_variable);
        let sum = velocity.get_or_insert_with(|| vec![[0.0; 3]; one.len()]);
        for (s, v) in sum.iter_mut().zip(&one) {
            for i in 0..3 {
                s[i] += sign * v[i];
            }
        }
    }
    let plate = (variable == Variable::Precompression).then_some(PRECOMPRESSION_DIRECTION);
    Move { velocity, is_drive: variable == Variable::Drive, plate }
}

#[cfg(test)]
#[path = "evaluator_tests.rs"]
mod tests;
