//! A scene: the experiment as it may really have been. The default scene is the nominal experiment.

pub use super::image::{ImageChange, Jump, Pose};
use crate::calibration::ObservedStep;
use crate::fem::{Departures, FIRM_BOND_KPA_PER_MM, Fibre, Field, PlateMotion};
use crate::mesh::BlockShape;
use crate::specimen::Specimen;

/// What differs from the nominal experiment. Causes change it; the laboratory predicts what would be recorded of it.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Changes of each hole: diameter, then centre along x and across, mm.
    pub holes: Vec<[f64; 3]>,
    /// Factors on the stiffness; they multiply.
    pub stiffness: Vec<Field>,
    /// Uniform swelling: logarithm of the volume ratio.
    pub log_growth: f64,
    /// Fibres.
    pub fibre: Option<Fibre>,
    /// The plates: fixed, moved.
    pub plates: [PlateMotion; 2],
    /// Motions of the plates at each step alone, added to the others. Steps without an entry have none.
    pub plates_at: Vec<[PlateMotion; 2]>,
    /// How far the block's faces lie off the drawing.
    pub shape: BlockShape,
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
            fixed_plate,
            moved_plate,
            bond_kpa_per_mm: bond,
            faces_per_mm: observed.faces_per_mm.clone(),
        }
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
            hole.diameter_mm += change[0];
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
