//! The samples of a test that share drive and load cell.

use super::{Outline, Sample, Specimen};

impl Specimen {
    /// Every kind of sample as a specimen of its own, the first one's first: `samples_in_parallel` of it, one each of
    /// the others. Their forces add to the force of this specimen; without other samples the only entry is the
    /// specimen itself.
    ///
    /// ```
    /// use lambdak::specimen::Specimen;
    /// let text = r#"{ "schema": "specimen/1", "name": "unlike", "test": "double_lap_shear",
    ///     "block": { "length_mm": 25.4, "thickness_mm": 5.5, "width_mm": 19.1 }, "drive_mm": [5.0],
    ///     "other_samples": [{ "block": { "length_mm": 25.4, "thickness_mm": 8.0, "width_mm": 19.1 } }] }"#;
    /// let samples = Specimen::from_json(text)?.samples();
    /// assert_eq!(samples[1].name, "unlike, sample 2");
    /// assert_eq!(samples[1].block.thickness_mm, 8.0);
    /// # Ok::<(), lambdak::specimen::SpecimenError>(())
    /// ```
    pub fn samples(&self) -> Vec<Specimen> {
        if self.other_samples.is_empty() {
            return vec![self.clone()];
        }
        let first = Specimen { other_samples: Vec::new(), ..self.clone() };
        let mut all = vec![first];
        all.extend(self.other_samples.iter().map(|sample| self.as_sample(sample)));
        for (index, specimen) in all.iter_mut().enumerate() {
            specimen.name = format!("{}, sample {}", self.name, index + 1);
        }
        all
    }

    /// One `sample` of this specimen's test, alone.
    pub(super) fn as_sample(&self, sample: &Sample) -> Specimen {
        Specimen {
            block: sample.block,
            outline: Outline::Block,
            holes: sample.holes.clone(),
            samples_in_parallel: 1,
            other_samples: Vec::new(),
            ..self.clone()
        }
    }

    /// The same samples with the kind of this index listed first: the one that a recording is of. `None` where there is
    /// no such kind.
    pub fn with_first(&self, index: usize) -> Option<Specimen> {
        if index == 0 {
            return Some(self.clone());
        }
        let chosen = self.other_samples.get(index - 1)?;
        let own = Sample { block: self.block, holes: self.holes.clone() };
        let mut others = vec![own; self.samples_in_parallel as usize];
        others.extend(self.other_samples.iter().enumerate().filter(|(n, _)| n + 1 != index).map(|(_, s)| s.clone()));
        Some(Specimen { other_samples: others, name: self.name.clone(), ..self.as_sample(chosen) })
    }

    /// How many samples share the load cell.
    pub fn num_samples(&self) -> usize {
        self.samples_in_parallel as usize + self.other_samples.len()
    }

    /// How many of each kind of [`Self::samples`] are scanned where the first `blocks_scanned` of all samples are, in
    /// the order in which they are listed.
    pub fn num_scanned(&self, blocks_scanned: u32) -> Vec<u32> {
        let of_first = blocks_scanned.min(self.samples_in_parallel);
        let left = blocks_scanned - of_first;
        let of_others = (0..self.other_samples.len()).map(|n| u32::from((n as u32) < left));
        std::iter::once(of_first).chain(of_others).collect()
    }

    /// Volume of the samples that are scanned where the first `blocks_scanned` are, mm³.
    pub fn scanned_volume_mm3(&self, blocks_scanned: u32) -> f64 {
        let counts = self.num_scanned(blocks_scanned);
        self.samples().iter().zip(counts).map(|(s, count)| f64::from(count) * s.volume_mm3()).sum()
    }

    /// The thickness of the thinnest sample at its thinnest, mm: what is sheared most.
    pub(super) fn thinnest_mm(&self) -> f64 {
        self.other_samples.iter().map(|s| s.block.thinnest_mm()).fold(self.block.thinnest_mm(), f64::min)
    }
}

#[cfg(test)]
mod tests {
    use crate::specimen::{Block, Hole, HoleAxis, Sample, Specimen, SpecimenError, TestKind};

    fn unlike() -> Specimen {
        let mut specimen = Specimen::from_json(include_str!("../../geometries/two-hole-shear.json")).expect("shipped");
        let block = Block { thickness_mm: 8.0, ..specimen.block };
        let hole = Hole::circle(HoleAxis::Width, [0.0, 0.0], 3.0);
        specimen.other_samples = vec![Sample { block, holes: vec![hole] }];
        specimen
    }

    #[test]
    fn samples_are_specimens_and_come_back_from_json() {
        let specimen = unlike();
        assert_eq!(specimen.validate(), Ok(()));
        assert_eq!(Specimen::from_json(&specimen.to_json()), Ok(specimen.clone()));
        let samples = specimen.samples();
        assert_eq!(samples.len(), 2);
        assert!(samples.iter().all(|s| s.validate().is_ok() && s.other_samples.is_empty()));
        assert_eq!((samples[0].samples_in_parallel, samples[1].samples_in_parallel), (2, 1));
        assert_eq!(samples[1].holes.len(), 1);
        assert_eq!(specimen.num_samples(), 3);
        // A file without them is written as it always was.
        let plain = Specimen { other_samples: Vec::new(), ..specimen };
        assert!(!plain.to_json().contains("other_samples"));
        assert_eq!(plain.samples(), vec![plain.clone()]);
    }

    #[test]
    fn the_first_blocks_are_scanned() {
        let specimen = unlike();
        assert_eq!(specimen.num_scanned(1), [1, 0]);
        assert_eq!(specimen.num_scanned(2), [2, 0]);
        assert_eq!(specimen.num_scanned(3), [2, 1]);
        let (two_holes, one) = (specimen.samples()[0].volume_mm3(), specimen.samples()[1].volume_mm3());
        // Sums of the same numbers.
        assert!((specimen.scanned_volume_mm3(3) - (2.0 * two_holes + one)).abs() < 1e-9);
    }

    #[test]
    fn another_sample_may_stand_first() {
        let specimen = unlike();
        let turned = specimen.with_first(1).expect("there are two kinds");
        assert_eq!((turned.block, &turned.holes), (specimen.other_samples[0].block, &specimen.other_samples[0].holes));
        assert_eq!((turned.num_samples(), turned.samples().len()), (3, 3));
        assert_eq!(turned.other_samples[1].holes, specimen.holes);
        assert_eq!(specimen.with_first(0), Some(specimen.clone()));
        assert_eq!(specimen.with_first(2), None);
    }

    #[test]
    fn what_is_wrong_with_a_further_sample_is_told_at_it() {
        let pointers = |s: &Specimen| s.field_errors().into_iter().map(|e| e.pointer).collect::<Vec<_>>();
        let mut specimen = unlike();
        specimen.other_samples[0].block.width_mm = -1.0;
        assert_eq!(pointers(&specimen), ["/other_samples/0/block/width_mm"]);
        let mut specimen = unlike();
        specimen.other_samples[0].holes[0].diameter_mm = 7.99;
        assert_eq!(pointers(&specimen), ["/other_samples/0/holes/0", "/other_samples/0/holes/0"]);
        // The thinnest sample limits the drive.
        let mut specimen = unlike();
        specimen.other_samples[0] = Sample { block: Block { thickness_mm: 3.0, ..specimen.block }, holes: Vec::new() };
        assert!((specimen.drive_limit_mm() - 4.5).abs() < 1e-12);
        assert_eq!(pointers(&specimen), ["/drive_mm/1", "/drive_mm/2"]);
        let pulled = Specimen { test: TestKind::Uniaxial, ..unlike() };
        assert!(pulled.field_errors().iter().any(|e| e.pointer == "/other_samples"));
        let many = Specimen { other_samples: vec![unlike().other_samples[0].clone(); 8], ..unlike() };
        assert!(matches!(many.validate(), Err(SpecimenError::TooManyOtherSamples { count: 8, limit: 7 })));
    }
}
