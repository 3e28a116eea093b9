//! The recording of an experiment with hidden causes.

use super::draw::{Draw, Hidden, HiddenCause};
use super::experiment::Experiment;
use super::history::{BEYOND, DRIFT_SD_N, History, history};
use crate::fem::{
    Departures, Equilibrium, Fibre, Field, ForwardModel, PlateMotion, PrepareError, SolveError, SolveOptions,
};
use crate::homogeneous::TableError;
use crate::material::Material;
use crate::mesh::{MeshOptions, half_extents_mm, mesh_specimen, mesh_specimen_along};
use crate::recording::{Filter, RecordedStep, Recording};
use crate::specimen::Specimen;
use crate::voxel::{Sampling, VoxelError, VoxelGrid, VoxelMask, VoxelOperator};

/// Strips thinner than this are not meshed, mm.
const LEAST_STRIP_MM: f64 = 0.3;
/// κ over the shear modulus of a rubber.
pub(super) const RUBBER: f64 = 130.0;
/// Element size as a factor on the standard one.
const MESH_FACTOR: f64 = 1.6;
/// Voxels of the concealed recordings, mm.
const VOXEL_MM: [f64; 3] = [1.5, 0.4, 1.1];
/// How much stiffer a layer at a bonded face is.
const LAYER_FACTOR: f64 = 60.0;
/// A block that is a wedge, among the geometries drawn.
const WEDGE: usize = 2;
/// Voxels without a signal show any displacement within a turn of phase, mm.
const LOST_MM: f64 = 1.5;

/// Parts of the largest drive at which the force is worked out too, for the load curve between the steps.
const PARTS_OF_CURVE: [f64; 4] = [0.06, 0.18, 0.55, 0.85];
/// A drive as near to another as this part of the largest is the same.
const SAME_PART: f64 = 0.02;
/// Drive over which a plate comes to sit out of its place, mm.
const SETTLED_MM: f64 = 0.4;

/// Why a recording cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConcealError {
    /// No equilibrium.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// No model.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// No voxels.
    #[error(transparent)]
    Voxel(#[from] VoxelError),
    /// No load curve.
    #[error(transparent)]
    Curve(#[from] TableError),
}

/// A recording and what its causes do to it.
#[derive(Clone, Debug)]
pub struct Concealed {
    /// The recording.
    pub recording: Recording,
    /// Root mean square change of the displacement by the causes at the largest drive, mm, the material unchanged.
    pub effect_rms_mm: f64,
    /// Largest change of a force by the causes, relative to it.
    pub effect_force_relative: f64,
}

/// What a scan of an experiment would show without noise.
pub(super) struct Shown {
    /// Voxels that hold material.
    pub(super) mask: VoxelMask,
    /// Displacement at every drive of the specimen (mm), at the voxels of the mask.
    pub(super) displacement: Vec<Vec<[f64; 3]>>,
    /// Forces at these drives, N.
    pub(super) forces: Vec<f64>,
    /// Force (N) over drive (mm) from rest to beyond the largest drive ([`BEYOND`]), where it was asked for.
    pub(super) curve: Vec<[f64; 2]>,
}

/// The drives of a specimen's load curve: between its steps and beyond the last of them, mm.
fn drives_of_curve(specimen: &Specimen) -> Vec<f64> {
    let largest = specimen.largest_drive_mm().abs();
    let parts = PARTS_OF_CURVE.into_iter().chain([BEYOND]).map(|part| part * largest);
    let is_new = |d: &f64| specimen.drive_mm.iter().all(|step| (step - d).abs() > SAME_PART * largest);
    parts.filter(is_new).collect()
}

/// What a scan of `experiment` with `specimen` would show, on prisms whose size is `mesh_factor` times the standard
/// one; the force at the drives of `between` too.
///
/// # Errors
/// [`ConcealError`].
pub(super) fn show(
    specimen: &Specimen,
    experiment: &Experiment,
    mesh_factor: f64,
    between: &[f64],
) -> Result<Shown, ConcealError> {
    let made = made_specimen(specimen, experiment);
    let model = model_of(&made, experiment, mesh_factor)?;
    let mut drives: Vec<f64> = specimen.drive_mm.iter().chain(between).copied().collect();
    drives.sort_by(f64::total_cmp);
    let on_the_way = path(&model, &made, experiment, &drives)?;
    let curve = std::iter::once([0.0, 0.0]).chain(drives.iter().zip(&on_the_way).map(|(d, s)| [*d, s.force_n]));
    let curve = curve.collect();
    let is_step = |d: &f64| specimen.drive_mm.iter().any(|step| (step - d).abs() <= 0.0);
    let states: Vec<Equilibrium> =
        drives.iter().zip(on_the_way).filter(|(d, _)| is_step(d)).map(|(_, state)| state).collect();
    let drawn = VoxelGrid::covering(specimen, VOXEL_MM)?;
    let mut grid = drawn.clone();
    for h in experiment.of(HiddenCause::Registration) {
        grid.origin_mm[h.which] += h.strength;
    }
    let mask = VoxelMask::of_specimen(&made, grid)?;
    let operator = VoxelOperator::new(&made, model.mesh(), &mask, Sampling::default())?;
    let num_steps = states.len();
    let mut displacement = Vec::with_capacity(num_steps);
    for (n, state) in states.iter().enumerate() {
        let mut field = operator.average(&state.displacement)?;
        for (u, &voxel) in field.iter_mut().zip(&mask.voxels) {
            for hidden in &experiment.hidden {
                image(u, drawn.center_mm(voxel as usize), hidden, specimen, n + 1 == num_steps);
            }
        }
        displacement.push(field);
    }
    Ok(Shown { mask, displacement, forces: states.iter().map(|s| s.force_n).collect(), curve })
}

/// Makes the recording of `experiment` with `specimen`.
///
/// # Errors
/// [`ConcealError`].
pub fn conceal(specimen: &Specimen, experiment: &Experiment) -> Result<Concealed, ConcealError> {
    let shown = show(specimen, experiment, MESH_FACTOR, &drives_of_curve(specimen))?;
    // What the nominal model would show, for the size of the effect.
    let plain = show(specimen, &experiment.nominal(RUBBER), MESH_FACTOR, &[])?;
    let last = specimen.drive_mm.len() - 1;
    let expected = plain.mask.spread(&plain.displacement[last], [f64::NAN; 3]);
    let (mut squares, mut count) = (0.0, 0usize);
    for (u, &voxel) in shown.displacement[last].iter().zip(&shown.mask.voxels) {
        for c in 0..3 {
            let change = u[c] - expected[voxel as usize][c];
            if change.is_finite() {
                squares += change * change;
                count += 1;
            }
        }
    }
    let mut noise = Draw::new(experiment.seed, 2);
    let mut steps = Vec::new();
    for (&drive_mm, field) in specimen.drive_mm.iter().zip(&shown.displacement) {
        let noisy: Vec<[f64; 3]> =
            field.iter().map(|u| u.map(|x| x + experiment.noise_sd_mm * noise.normal())).collect();
        steps.push(RecordedStep {
            drive_mm,
            force_n: None,
            force_sd_n: Some(DRIFT_SD_N),
            window_s: None,
            displacement: shown.mask.spread(&noisy, [f64::NAN; 3]),
        });
    }
    let History { load, windows_s, means_n } = history(&shown.curve, &specimen.drive_mm, experiment, &mut noise)?;
    let mut effect_force_relative = 0.0f64;
    for (n, step) in steps.iter_mut().enumerate() {
        step.force_n = Some(means_n[n]);
        step.window_s = Some(windows_s[n]);
        effect_force_relative = effect_force_relative.max((means_n[n] / plain.forces[n] - 1.0).abs());
        lose_voxels(&mut step.displacement, &shown.mask, experiment.lost_share, &mut noise);
    }
    let recording = Recording {
        id: format!("hidden-{}", experiment.seed),
        specimen: specimen.clone(),
        grid: VoxelGrid::covering(specimen, VOXEL_MM)?,
        mask: shown.mask.spread(&vec![true; shown.mask.num_voxels()], false),
        steps,
        noise_sd_mm: experiment.is_noise_stated.then_some([experiment.noise_sd_mm; 3]),
        filter: Filter::None,
        load: Some(load),
        notes: None,
    };
    let effect_rms_mm = (squares / count.max(1) as f64).sqrt();
    Ok(Concealed { recording, effect_rms_mm, effect_force_relative })
}

/// Voxels that show nothing of the sample, as a wrong mask or lost fringes leave them: each with a chance of `share`.
fn lose_voxels(displacement: &mut [[f64; 3]], mask: &VoxelMask, share: f64, noise: &mut Draw) {
    if share > 0.0 {
        for &voxel in &mask.voxels {
            if noise.within(0.0, 1.0) < share {
                displacement[voxel as usize] = [0; 3].map(|_| noise.within(-LOST_MM, LOST_MM));
            }
        }
    }
}

/// The specimen as made, remeshed from its drawing.
fn made_specimen(specimen: &Specimen, experiment: &Experiment) -> Specimen {
    let mut made = specimen.clone();
    for hidden in &experiment.hidden {
        match hidden.cause {
            HiddenCause::Hole => {
                if let Some(hole) = made.holes.get_mut(hidden.which) {
                    *hole = hole.grown(hidden.strength * hidden.direction[0]);
                    hole.center_mm[0] += hidden.strength * hidden.direction[1];
                    hole.center_mm[1] += hidden.strength * hidden.direction[2];
                }
            }
            HiddenCause::Outline if hidden.which == 0 => made.block.length_mm += hidden.strength,
            HiddenCause::Outline if hidden.which == 1 => made.block.width_mm += hidden.strength,
            _ => {}
        }
    }
    made
}

/// Prisms; a free patch is made of free nodes, whose elements end at its edges unless these come too near to a hole or
/// would make an element too flat.
fn model_of(made: &Specimen, experiment: &Experiment, mesh_factor: f64) -> Result<ForwardModel, ConcealError> {
    let options = MeshOptions { use_mirror: false, force_prisms: true, ..MeshOptions::scaled(made, mesh_factor) };
    let patch = experiment.of(HiddenCause::Debond).next();
    let lines = patch.map_or_else(Vec::new, |hidden| patch_lines(made, hidden));
    let along = (!lines.is_empty()).then(|| mesh_specimen_along(made, &options, &lines)).and_then(Result::ok);
    let mut mesh = along.map_or_else(|| mesh_specimen(made, &options), Ok).map_err(PrepareError::from)?;
    for wedge in experiment.of(HiddenCause::Outline).filter(|h| h.which == WEDGE) {
        // Wider by half of it at one end, narrower at the other.
        for x in &mut mesh.nodes {
            x[2] *= 1.0 + wedge.strength * x[0] / (made.block.length_mm * made.block.width_mm);
        }
    }
    let half = [0.5 * made.block.length_mm, 0.0, 0.5 * made.block.width_mm];
    let is_free = |x: [f64; 3], is_moved: bool| {
        experiment.of(HiddenCause::Bond).any(|h| h.which != usize::from(!is_moved))
            || experiment
                .of(HiddenCause::Debond)
                .any(|h| is_moved == (h.which == 1) && [0, 2].into_iter().all(|a| is_inside(x[a], h, a, half[a])))
    };
    Ok(ForwardModel::with_released(mesh, made, &is_free)?)
}

/// Whether a node is in the patch along an axis: its edges hold, but for those that are the face's own.
fn is_inside(x: f64, hidden: &Hidden, axis: usize, half: f64) -> bool {
    let away = x - hidden.center_mm[axis];
    let edge = hidden.center_mm[axis] + away.signum() * 0.5 * hidden.extent_mm[axis];
    let is_own = edge.abs() > half - LEAST_STRIP_MM;
    is_own || away.abs() < 0.5 * hidden.extent_mm[axis] - 1e-6
}

/// Edges of the patch inside the section; none where an element between them and a hole or a side would be a sliver.
fn patch_lines(made: &Specimen, hidden: &Hidden) -> Vec<[[f64; 2]; 2]> {
    let half = [0.5 * made.block.length_mm, 0.5 * made.block.width_mm];
    let edges = [(0, half[0]), (2, half[1])].map(|(axis, half)| {
        // An edge nearly on the face's own is the face's own.
        [-0.5, 0.5]
            .map(|s| hidden.center_mm[axis] + s * hidden.extent_mm[axis])
            .map(|edge| if edge.abs() > half - LEAST_STRIP_MM { half * edge.signum() } else { edge })
    });
    let ([x0, x1], [z0, z1]) = (edges[0], edges[1]);
    let sides = [[[x0, z0], [x0, z1]], [[x1, z0], [x1, z1]], [[x0, z0], [x1, z0]], [[x0, z1], [x1, z1]]];
    let is_own = |l: &[[f64; 2]; 2]| (0..2).any(|c| l.iter().all(|p| p[c].abs() >= half[c] - 1e-9));
    let lines: Vec<[[f64; 2]; 2]> = sides.into_iter().filter(|l| !is_own(l)).collect();
    let is_near_hole = |l: &[[f64; 2]; 2]| {
        made.holes.iter().any(|h| {
            let nearest = [0, 1].map(|c| h.center_mm[c].clamp(l[0][c].min(l[1][c]), l[0][c].max(l[1][c])));
            let distance = (nearest[0] - h.center_mm[0]).hypot(nearest[1] - h.center_mm[1]);
            distance < h.wall().half_mm()[0] + LEAST_STRIP_MM
        })
    };
    if lines.iter().any(is_near_hole) { Vec::new() } else { lines }
}

/// What departs from the nominal experiment at a drive.
fn departures(made: &Specimen, experiment: &Experiment, drive_mm: f64) -> Departures {
    let mut d = Departures::default();
    for hidden in &experiment.hidden {
        depart(&mut d, made, &experiment.material, hidden, drive_mm);
    }
    d
}

fn depart(d: &mut Departures, made: &Specimen, material: &Material, hidden: &Hidden, drive_mm: f64) {
    let half = half_extents_mm(made);
    let (strength, which) = (hidden.strength, hidden.which);
    let largest = made.largest_drive_mm().abs().max(1e-9);
    let shear_modulus = material.initial_shear_modulus_kpa();
    let mut motion = PlateMotion::default();
    match hidden.cause {
        HiddenCause::Gradient => stiffen(d, move |x| 1.0 + strength * x[which] / half[which]),
        HiddenCause::Inclusion => {
            let (center, radius) = (hidden.center_mm, 0.5 * hidden.extent_mm[0]);
            stiffen(d, move |x| {
                let r = (0..3).map(|a| (x[a] - center[a]).powi(2)).sum::<f64>().sqrt();
                if r < radius { strength.exp() } else { 1.0 }
            });
        }
        HiddenCause::Layer => {
            let [moved_mm, slope_mm, _] = hidden.extent_mm;
            stiffen(d, move |x| {
                let slant = slope_mm * x[0] / half[0];
                let is_in = x[1] < -half[1] + strength + slant || x[1] > half[1] - moved_mm + slant;
                if is_in { LAYER_FACTOR } else { 1.0 }
            });
        }
        HiddenCause::Swelling => d.log_growth = Some(Field::new(move |_| strength)),
        HiddenCause::Fibre => {
            d.fibre = Some(Fibre { direction: hidden.direction, modulus_kpa: strength * shear_modulus });
        }
        HiddenCause::Tilt => motion.rotation_rad_per_mm[which] = strength.to_radians() / largest,
        HiddenCause::Offaxis => motion.translation_per_mm[which] = strength / largest,
        HiddenCause::Debond => d.bond_kpa_per_mm = Some(Field::new(|_| 0.0)),
        HiddenCause::Bond => d.bond_kpa_per_mm = Some(Field::new(move |_| 1.0 / strength)),
        // Play is taken up on the way; so is what lets a plate sit out of its place.
        HiddenCause::Slack => motion.translation_mm[0] = -strength * taken_up(drive_mm, strength.abs()),
        HiddenCause::Mount if which < 2 => {
            motion.translation_mm[1 + which] = strength * taken_up(drive_mm, SETTLED_MM);
        }
        HiddenCause::Mount => {
            motion.rotation_rad[which - 2] = strength.to_radians() * taken_up(drive_mm, SETTLED_MM);
        }
        HiddenCause::Travel => {
            let part = strength * (drive_mm.abs() / largest).powf(hidden.extent_mm[0]);
            motion.translation_mm = hidden.direction.map(|x| part * x);
        }
        _ => {}
    }
    d.moved_plate = d.moved_plate.plus(&motion);
}

/// The part of a play of `over_mm` that is taken up at a drive.
fn taken_up(drive_mm: f64, over_mm: f64) -> f64 {
    1.0 - (-drive_mm.abs() / over_mm.max(1e-9)).exp()
}

/// A factor on the stiffness, beside those that are there.
fn stiffen(d: &mut Departures, factor: impl Fn([f64; 3]) -> f64 + Send + Sync + 'static) {
    d.stiffness_factor = Some(match d.stiffness_factor.take() {
        Some(other) => Field::new(move |x| other.at(x) * factor(x)),
        None => Field::new(factor),
    });
}

/// Equilibria at the commanded drives.
fn path(
    model: &ForwardModel,
    made: &Specimen,
    experiment: &Experiment,
    drives: &[f64],
) -> Result<Vec<Equilibrium>, ConcealError> {
    let options = SolveOptions::trial();
    let never = || false;
    let material = &experiment.material;
    let is_out_of_place = experiment.hidden.iter().any(|h| matches!(h.cause, HiddenCause::Mount | HiddenCause::Travel));
    let mut found: Vec<Equilibrium> = Vec::new();
    for &drive in drives {
        let mut here = model.departed(&departures(made, experiment, drive));
        let mut state = match here.solve(material, drive, found.last(), &options, &never) {
            Err(_) if is_out_of_place => here.solve_by_parts(material, drive, &options, &never)?,
            found => found?,
        };
        for hidden in experiment.of(HiddenCause::Compliance) {
            // What the sample sees: the load train takes its part. A secant iteration on the real drive.
            let mut real = drive;
            for _ in 0..6 {
                let stiffness = state.force_n / real;
                let next = drive / (1.0 + hidden.strength * stiffness);
                let change = next - real;
                real = next;
                state = here.solve(material, real, Some(&state), &options, &never)?;
                if change.abs() < 1e-6 {
                    break;
                }
            }
        }
        found.push(state);
    }
    Ok(found)
}

/// What the scan makes of a displacement.
fn image(u: &mut [f64; 3], x: [f64; 3], hidden: &Hidden, specimen: &Specimen, is_last: bool) {
    let b = specimen.block;
    let t = [x[0] / b.length_mm, x[1] / b.thickness_mm, x[2] / b.width_mm].map(|t| 2.0 * t);
    match hidden.cause {
        HiddenCause::Gain => u[hidden.which] *= 1.0 + hidden.strength,
        HiddenCause::Background => {
            let d = hidden.direction;
            u[hidden.which] += hidden.strength * (1.0 + d[0] * t[0] + d[1] * t[2] + 0.5 * d[2] * t[0] * t[2]);
        }
        HiddenCause::Wrap
            if is_last && (0..3).all(|a| (x[a] - hidden.center_mm[a]).abs() < 0.5 * hidden.extent_mm[a]) =>
        {
            u[hidden.which] += hidden.strength;
        }
        _ => {}
    }
}
