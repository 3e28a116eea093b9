//! A scene: the experiment as it may really have been. The default scene is the nominal experiment.

pub use super::image::{ImageChange, Jump, Pose};
use crate::calibration::ObservedStep;
use crate::fem::{Departures, FIRM_BOND_KPA_PER_MM, Fibre, Field, LawCorrection, PlateMotion};
use crate::mesh::{BlockShape, Cut};
use crate::specimen::Specimen;

/// What differs from the nominal experiment. Causes change it; the laboratory predicts what would be recorded of it.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Changes of each hole: diameter (of one that is no circle both extents), then centre along x and across, mm.
    pub holes: Vec<[f64; 3]>,
    /// Factors on the stiffness; they multiply.
    pub stiffness: Vec<Field>,
    /// Uniform swelling: logarithm of the volume ratio.
    pub log_growth: f64,
    /// Fibres.
    pub fibre: Option<Fibre>,
    /// A correction of the material's law.
    pub law: Option<LawCorrection>,
    /// The plates: fixed, moved.
    pub plates: [PlateMotion; 2],
    /// Motions of the plates at each step alone, added to the others. Steps without an entry have none.
    pub plates_at: Vec<[PlateMotion; 2]>,
    /// How far the block's faces lie off the drawing.
    pub shape: BlockShape,
    /// A cut through the sample.
    pub cut: Option<MovedCut>,
    /// Real minus commanded drive per newton of the measured force, mm/N.
    pub compliance_mm_per_n: f64,
    /// How loose the bond is on the fixed and the moved face, from 0 (firm) to 1 (gone). Where several fields overlap,
    /// the loosest counts.
    pub looseness: [Vec<Field>; 2],
    /// Compliance of the whole bond, fixed and moved face, mm/kPa.
    pub bond_mm_per_kpa: [f64; 2],
    /// The image.
    pub image: ImageChange,
    /// Added to the load cell's reading, N.
    pub force_offset_n: f64,
    /// Added to the load cell's reading, N per N.
    pub force_gain: f64,
}

/// A cut that was moved from where its mesh was made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MovedCut {
    /// Where the mesh has it. Scenes that differ in this have meshes of their own.
    pub meshed: Cut,
    /// Where it is.
    pub cut: Cut,
}

impl Scene {
    /// The departures from the nominal model at the step of this number, which is `observed`. A bond is loose or firm
    /// compared with `bond_scale_kpa_per_mm`, the stiffness of the sample under its bond. The bonded faces lie across
    /// `face_axis`.
    pub fn departures(
        &self,
        step: usize,
        observed: &ObservedStep,
        bond_scale_kpa_per_mm: f64,
        face_axis: usize,
    ) -> Departures {
        let product = self.stiffness.clone();
        let stiffness_factor = (!product.is_empty())
            .then(|| Field::new(move |x| product.iter().map(|f| f.at(x)).product::<f64>().max(1e-2)));
        let growth = self.log_growth;
        let own = self.plates_at.get(step).copied().unwrap_or_default();
        let fixed_plate = self.plates[0].plus(&own[0]);
        let mut moved_plate = self.plates[1].plus(&own[1]);
        moved_plate.translation_mm[0] += self.compliance_mm_per_n * observed.force.map_or(0.0, |f| f.value_n);
        let [fixed, moved] = self.looseness.clone();
        let soft = self.bond_mm_per_kpa;
        let bond = self.releases().contains(&true).then(|| {
            Field::new(move |x| {
                let (list, compliance) = if x[face_axis] > 0.0 { (&moved, soft[1]) } else { (&fixed, soft[0]) };
                let loose = list.iter().map(|f| f.at(x)).fold(0.0, f64::max);
                let held = bond_of(loose, bond_scale_kpa_per_mm);
                // The patch's bond and the soft layer act one after the other: their compliances add.
                held / (1.0 + compliance.max(0.0) * held)
            })
        });
        Departures {
            stiffness_factor,
            log_growth: (growth.abs() > 0.0).then(|| Field::new(move |_| growth)),
            fibre: self.fibre,
            law: self.law,
            fixed_plate,
            moved_plate,
            bond_kpa_per_mm: bond,
            faces_per_mm: observed.faces_per_mm.clone(),
        }
    }

    /// The scene at a drive between the steps of `observed`, as one step's: what each step has of its own, and the
    /// measured force, go from step to step in proportion to the drive, from nothing at rest. The moved plate lags by
    /// no more than the drive.
    pub(super) fn between_steps(&self, drive_mm: f64, observed: &[ObservedStep]) -> (Scene, ObservedStep) {
        let mut scene = self.clone();
        let mut step = ObservedStep {
            drive_mm,
            force: None,
            displacement: Vec::new(),
            relative_noise: None,
            faces_per_mm: [None, None],
        };
        if let Some(first) = observed.first() {
            step.faces_per_mm.clone_from(&first.faces_per_mm);
        }
        let mut before = (0.0, [PlateMotion::default(); 2], 0.0);
        let mut force_n = 0.0;
        scene.plates_at = vec![Default::default()];
        let mut order: Vec<usize> = (0..observed.len()).collect();
        order.sort_by(|a, b| observed[*a].drive_mm.abs().total_cmp(&observed[*b].drive_mm.abs()));
        for (place, &n) in order.iter().enumerate() {
            let own = self.plates_at.get(n).copied().unwrap_or_default();
            let after = (observed[n].drive_mm.abs(), own, observed[n].force.map_or(0.0, |f| f.value_n));
            let span = after.0 - before.0;
            let part = if span > 0.0 { (drive_mm.abs() - before.0) / span } else { 1.0 };
            let is_last = place + 1 == order.len();
            if part <= 1.0 || is_last {
                // Beyond the last step plates stay as they are there; the force goes on.
                let held = part.min(1.0);
                let blend = |a: &PlateMotion, b: &PlateMotion| a.scaled(1.0 - held).plus(&b.scaled(held));
                scene.plates_at[0] = [0, 1].map(|i| blend(&before.1[i], &after.1[i]));
                force_n = before.2 + part * (after.2 - before.2);
                break;
            }
            before = after;
        }
        let moved = &mut scene.plates[1].translation_mm;
        moved[0] += scene.compliance_mm_per_n * force_n;
        scene.compliance_mm_per_n = 0.0;
        let lag = -(moved[0] + scene.plates_at[0][1].translation_mm[0]) * drive_mm.signum();
        moved[0] += (lag - drive_mm.abs()).max(0.0) * drive_mm.signum();
        (scene, step)
    }

    /// Whether the nodes of the fixed and of the moved face must be free to leave their plate.
    pub fn releases(&self) -> [bool; 2] {
        [0, 1].map(|face| !self.looseness[face].is_empty() || self.bond_mm_per_kpa[face].abs() > 0.0)
    }

    /// The motions of the plates at a step alone, to change.
    pub fn plates_at_mut(&mut self, step: usize) -> &mut [PlateMotion; 2] {
        if self.plates_at.len() <= step {
            self.plates_at.resize(step + 1, Default::default());
        }
        &mut self.plates_at[step]
    }

    /// The specimen as drawn, with its holes as made.
    pub fn specimen(&self, nominal: &Specimen) -> Specimen {
        let mut made = nominal.clone();
        for (hole, change) in made.holes.iter_mut().zip(&self.holes) {
            *hole = hole.grown(change[0]);
            hole.center_mm[0] += change[1];
            hole.center_mm[1] += change[2];
        }
        made
    }
}

/// Stiffness (kPa/mm) of a bond whose looseness is `loose`, from 0 (firm) to 1 (gone).
fn bond_of(loose: f64, scale: f64) -> f64 {
    let loose = loose.clamp(0.0, 1.0);
    (scale * (1.0 - loose) / loose.max(1e-9)).min(FIRM_BOND_KPA_PER_MM)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::ObservedForce;

    fn step(drive_mm: f64, value_n: f64) -> ObservedStep {
        let force = Some(ObservedForce { value_n, sd_n: 0.01 });
        ObservedStep { drive_mm, force, displacement: Vec::new(), relative_noise: None, faces_per_mm: [None, None] }
    }

    /// Translation of the moved plate along x of a scene at a drive, mm.
    fn moved_x(scene: &Scene, drive_mm: f64, steps: &[ObservedStep]) -> f64 {
        let (here, step) = scene.between_steps(drive_mm, steps);
        here.departures(0, &step, 1.0, 1).moved_plate.translation_mm[0]
    }

    #[test]
    fn a_plate_lags_by_no_more_than_the_drive() {
        let steps = [step(2.0, 4.0), step(4.0, 8.0)];
        let mut scene = Scene::default();
        scene.plates[1].translation_mm[0] = -0.3;
        assert_eq!(moved_x(&scene, 2.0, &steps), -0.3);
        // Rounding only, here and below.
        assert!((moved_x(&scene, 0.1, &steps) + 0.1).abs() < 1e-12);
        assert!((moved_x(&scene, -0.1, &steps) + 0.3).abs() < 1e-12, "it leads in the other direction");
    }

    #[test]
    fn own_values_and_forces_go_from_step_to_step() {
        let steps = [step(2.0, 4.0), step(4.0, 6.0)];
        let mut scene = Scene { compliance_mm_per_n: -0.01, ..Scene::default() };
        scene.plates_at_mut(0)[1].translation_mm[0] = -0.1;
        scene.plates_at_mut(1)[1].translation_mm[0] = -0.3;
        for (drive, expected) in [(1.0, -0.05 - 0.02), (2.0, -0.1 - 0.04), (3.0, -0.2 - 0.05), (4.0, -0.3 - 0.06)] {
            assert!((moved_x(&scene, drive, &steps) - expected).abs() < 1e-12, "{drive} mm");
        }
        // Beyond the last step the plate's own motion stays, and the force goes on.
        assert!((moved_x(&scene, 5.0, &steps) - (-0.3 - 0.07)).abs() < 1e-12);
    }
}
