//! Which rules a study violates.

use super::aim::ObjectiveKind;
use super::detection::{countable, counted};
use super::range::Range;
use super::structure::can_be_notched;
use super::study::{MaterialPrior, Study, VaryHoleShapes};
use super::study_error::StudyError;
use super::study_limits::{
    MAX_COUNT, MAX_HOLES_TO_TRY, MAX_LENGTH_MM, MAX_RELATIVE_SD, MAX_WEIGHT, MIN_LENGTH_MM, MIN_WEIGHT,
};
use crate::field::{FieldError, FieldPath};
use crate::specimen::{HoleAxis, MAX_HOLE_ANGLE_DEG, MAX_NAME_LENGTH, MAX_PRECOMPRESSION, Outline, Symmetry, TestKind};

impl Study {
    /// Checks a study and all of its parts. Call it on a study that was not read by this program's readers.
    ///
    /// # Errors
    /// [`StudyError`]: the first problem found.
    pub fn validate(&self) -> Result<(), StudyError> {
        self.problems().into_iter().next().map_or(Ok(()), Err)
    }

    /// Every rule that the study violates, with pointers into it; the first is that of [`Study::validate`].
    pub fn field_errors(&self) -> Vec<FieldError> {
        let base = self.base.field_errors().into_iter().map(|e| e.below("/base"));
        let limits = self.limits.field_errors().into_iter().map(|e| e.below("/limits"));
        let materials = self.materials.iter().enumerate().flat_map(|(index, prior)| {
            let errors = prior.material.field_errors().into_iter();
            errors.map(move |e| e.below(&format!("/materials/{index}/material")))
        });
        let is_of_a_part =
            |e: &StudyError| matches!(e, StudyError::Base(_) | StudyError::Limits(_) | StudyError::Material { .. });
        let own = self.problems().into_iter().filter(|e| !is_of_a_part(e)).map(|e| e.field_error());
        base.chain(limits).chain(materials).chain(own).collect()
    }

    /// Every rule that the study violates; of the base, the limits and each material the first one.
    fn problems(&self) -> Vec<StudyError> {
        let mut problems = Vec::new();
        problems.extend(self.base.validate().err().map(StudyError::Base));
        problems.extend(self.limits.validate().err().map(StudyError::Limits));
        problems.extend(self.scan.field_errors().into_iter().map(StudyError::Scan));
        let remedy = "a design is judged by scans of the volume; evaluate designs for cameras one by one";
        problems.extend(self.scan.needs_volume(remedy).err().map(StudyError::Scan));
        problems.extend(self.protocol.field_errors().into_iter().map(StudyError::Protocol));
        let length = self.name.chars().count();
        if length > MAX_NAME_LENGTH {
            problems.push(StudyError::NameTooLong { length, limit: MAX_NAME_LENGTH });
        }
        self.check_materials(&mut problems);
        self.check_variation(&mut problems);
        self.check_blocks(&mut problems);
        self.check_scan(&mut problems);
        if self.objective.kind == ObjectiveKind::TellApart && self.materials.len() < 2 {
            problems.push(StudyError::NothingToTellApart { count: self.materials.len() });
        }
        let parameters =
            |prior: &MaterialPrior| prior.material.shear_parameters().map(|p| p.name()).collect::<Vec<_>>();
        self.objective.check(&self.materials.iter().map(parameters).collect::<Vec<_>>(), &mut problems);
        for (part, name, count, least) in [
            ("budget", "explore", self.budget.explore, 1),
            ("budget", "refine", self.budget.refine, 0),
            ("budget", "iterations", self.budget.iterations, 1),
            ("budget", "propose", self.budget.propose, 0),
            ("budget", "confirm", self.budget.confirm, 1),
            ("budget", "scans", self.budget.scans, 1),
            ("verification", "draws", self.verification.draws, 1),
        ] {
            if !(least..=MAX_COUNT).contains(&count) {
                let (field, allowed) = (FieldPath::of(part).name(name), format!("from {least} to {MAX_COUNT}"));
                problems.push(StudyError::OutOfRange { field, value: count as f64, allowed });
            }
        }
        let found = match self.limits.symmetry {
            Symmetry::MirrorY => "mirror_y",
            Symmetry::MirrorXAndY => "mirror_x_and_y",
            _ => return problems,
        };
        problems.push(StudyError::UnsupportedSymmetry { found });
        problems
    }

    fn check_materials(&self, problems: &mut Vec<StudyError>) {
        if self.materials.is_empty() {
            problems.push(StudyError::NoMaterials);
        }
        for (index, prior) in self.materials.iter().enumerate() {
            if let Err(error) = prior.material.validate() {
                problems.push(StudyError::Material { index, name: prior.name.clone(), error });
            }
            if self.materials[..index].iter().any(|other| other.name == prior.name) {
                problems.push(StudyError::SameName { index, name: prior.name.clone() });
            }
            let field = |name: &str| FieldPath::of("materials").index(index).name(name);
            if !(0.0..=MAX_RELATIVE_SD).contains(&prior.relative_sd) {
                let (value, allowed) = (prior.relative_sd, format!("from 0 to {MAX_RELATIVE_SD}"));
                problems.push(StudyError::OutOfRange { field: field("relative_sd"), value, allowed });
            }
            if !(MIN_WEIGHT..=MAX_WEIGHT).contains(&prior.weight) {
                let allowed = format!("positive, from {MIN_WEIGHT} to {MAX_WEIGHT}");
                problems.push(StudyError::OutOfRange { field: field("weight"), value: prior.weight, allowed });
            }
        }
    }

    /// Whether the samples, what of them varies and which are scanned fit together.
    fn check_blocks(&self, problems: &mut Vec<StudyError>) {
        let (base, protocol) = (&self.base, &self.protocol);
        // The base has one scan in all of the time; shares of several are found for each design.
        if !protocol.scan_share.is_empty() {
            let error = FieldError::new("/scan_share", format!("a list of {}", protocol.scan_share.len()), "left out");
            problems.push(StudyError::Protocol(error.remedy("vary.earlier_scan_mm finds the shares of a second scan")));
        } else if base.samples_in_parallel > 0 {
            problems.extend(protocol.suits(base, 1).err().map(|e| StudyError::Protocol(e.field_error())));
        }
        let count = self.vary.other_samples.len();
        if count > base.other_samples.len() {
            problems.push(StudyError::NoSuchSamples { count, limit: base.other_samples.len() });
        }
        for (index, other) in self.vary.other_samples.iter().enumerate() {
            if other.is_like_first && (other.length_mm.is_some() || other.width_mm.is_some()) {
                problems.push(StudyError::SampleLikeFirst { index });
            }
            let named =
                [("length_mm", other.length_mm), ("thickness_mm", other.thickness_mm), ("width_mm", other.width_mm)];
            for (name, interval) in named {
                let path = || FieldPath::of("vary").name("other_samples").index(index).name(name);
                if let Some(range) = interval {
                    check_range(path, range, problems);
                }
            }
        }
        let num_blocks = base.other_samples.len() + protocol.blocks_scanned as usize;
        if self.objective.kind == ObjectiveKind::TellApart && num_blocks > 1 {
            problems.push(StudyError::SeveralBlocksToTellApart);
        }
        if self.objective.kind == ObjectiveKind::Detect && num_blocks > 1 {
            problems.push(StudyError::SeveralBlocksToDiagnose);
        }
        let is_uncertain = self.materials.iter().any(|prior| prior.relative_sd > 0.0);
        let needs_integrals = self.budget.refine > 0 || is_uncertain || self.objective.kind == ObjectiveKind::TellApart;
        if self.vary.earlier_scan_mm.is_some() && needs_integrals {
            problems.push(StudyError::EarlierScanNeedsVoxels);
        }
        if self.objective.kind == ObjectiveKind::Detect {
            if self.budget.refine > 0 || is_uncertain {
                problems.push(StudyError::DetectNeedsVoxels);
            }
            if let Err(name) = counted(self) {
                problems.push(StudyError::UnknownCause { name, known: countable(self) });
            }
        }
        if !base.other_samples.is_empty() && self.tests().contains(&TestKind::Uniaxial) {
            problems.push(StudyError::OtherSamplesInTension);
        }
        self.check_wedge(problems);
    }

    /// Whether what is sought knows what the scan's encoding costs, and the scan can vary as it is to.
    fn check_scan(&self, problems: &mut Vec<StudyError>) {
        let kind = self.objective.kind;
        if self.budget.refine > 0 || matches!(kind, ObjectiveKind::TellApart | ObjectiveKind::Detect) {
            let remedy =
                "gradients, tell_apart and detect take it so: set budget.refine to 0 and choose another objective.kind";
            problems.extend(self.scan.needs_even_noise(remedy).err().map(StudyError::Scan));
        }
        if let Some(vary) = &self.vary.scan {
            problems.extend(vary.field_errors(&self.scan, kind).into_iter().map(StudyError::VaryScan));
        }
    }

    /// Whether all that is tried can be done with a wedge, which stays as it is in the base.
    fn check_wedge(&self, problems: &mut Vec<StudyError>) {
        let others = self.base.other_samples.iter().map(|sample| sample.block.wedge_mm);
        let wedges_mm = std::iter::once(self.base.block.wedge_mm).chain(others);
        let Some(value_mm) = wedges_mm.into_iter().find(|wedge_mm| wedge_mm.abs() > 0.0) else { return };
        let is_mirrored = self.limits.symmetry.mirrors().iter().any(|signs| signs[0] < 0.0);
        for (is_unsuited, reason) in [
            (self.tests().contains(&TestKind::Uniaxial), "only double-lap shear is of wedges: vary no other tests"),
            (
                self.axes().contains(&HoleAxis::Width),
                "holes of a wedge run along its thickness: leave width out of vary.axes",
            ),
            (is_mirrored, "a wedge is not alike at both ends: choose the symmetry none or mirror_z in limits"),
            (
                self.objective.kind == ObjectiveKind::Detect,
                "a diagnosis is of even blocks: choose another objective.kind",
            ),
        ] {
            if is_unsuited {
                problems.push(StudyError::UnsuitedWedge { value_mm, reason });
            }
        }
    }

    fn check_variation(&self, problems: &mut Vec<StudyError>) {
        let vary = &self.vary;
        let max_holes = vary.hole_count.max;
        if max_holes > MAX_HOLES_TO_TRY {
            let field = FieldPath::of("vary").name("hole_count").name("max");
            let allowed = format!("from 0 to {MAX_HOLES_TO_TRY}");
            problems.push(StudyError::OutOfRange { field, value: max_holes as f64, allowed });
        }
        if vary.hole_count.min > max_holes {
            problems.push(StudyError::EmptyCountRange { min: vary.hole_count.min, max: max_holes });
        }
        if max_holes > 0 && vary.axes.as_ref().is_some_and(Vec::is_empty) {
            problems.push(StudyError::NoAxes { max_holes });
        }
        for (name, interval) in [
            ("drive_mm", Some(vary.drive_mm)),
            ("length_mm", vary.length_mm),
            ("thickness_mm", vary.thickness_mm),
            ("width_mm", vary.width_mm),
            ("earlier_scan_mm", vary.earlier_scan_mm),
        ] {
            if let Some(range) = interval {
                check_range(|| FieldPath::of("vary").name(name), range, problems);
            }
        }
        self.check_gauge(problems);
        self.check_notches(problems);
        self.check_plates(problems);
        if let Some(shapes) = &vary.hole_shapes {
            let path = || FieldPath::of("vary").name("hole_shapes").name("elongation_mm");
            check_range(path, shapes.elongation_mm, problems);
            check_hole_shapes(shapes, problems);
        }
        if let Some(limit_mm) = self.limits.max_drive_mm
            && vary.drive_mm.min > limit_mm
        {
            problems.push(StudyError::NoDrive { min_mm: vary.drive_mm.min, limit_mm });
        }
    }
}

impl Study {
    /// Whether there are plates where the force across them is limited or their precompression is to vary, and thick
    /// enough a block for it. Designs that are too thin for theirs are passed over as ones that cannot be made.
    fn check_plates(&self, problems: &mut Vec<StudyError>) {
        let has_plates = self.tests().contains(&TestKind::DoubleLapShear);
        if self.limits.max_normal_force_n.is_some() && !has_plates {
            problems.push(StudyError::NormalForceWithoutPlates);
        }
        let Some(range) = self.vary.precompression_mm else { return };
        if !has_plates {
            problems.push(StudyError::PrecompressionWithoutPlates);
        }
        let thickest_mm = self.vary.thickness_mm.map_or(self.base.block.thickness_mm, |r| r.max);
        let limit_mm = MAX_PRECOMPRESSION * thickest_mm;
        let field = |end: &str| FieldPath::of("vary").name("precompression_mm").name(end);
        if !(range.min.abs() <= limit_mm) {
            let allowed =
                format!("from {:.4} to {limit_mm:.4} mm, {MAX_PRECOMPRESSION} times the thickness", -limit_mm);
            problems.push(StudyError::OutOfRange { field: field("min"), value: range.min, allowed });
        }
        if !(range.max >= range.min && range.max <= limit_mm) {
            let allowed =
                format!("at least its min, at most {limit_mm:.4} mm, {MAX_PRECOMPRESSION} times the thickness");
            problems.push(StudyError::OutOfRange { field: field("max"), value: range.max, allowed });
        }
    }

    /// Whether sides for notches are named once, and a structure can have them.
    fn check_notches(&self, problems: &mut Vec<StudyError>) {
        let sides = &self.vary.notches;
        if sides.iter().enumerate().any(|(i, side)| sides[..i].contains(side)) {
            problems.push(StudyError::NotchedSides { count: sides.len() });
        }
        let is_block = self.base.outline.dumbbell().is_none();
        if !sides.is_empty() && (!is_block || !can_be_notched(self)) {
            problems.push(StudyError::NoPlaceForNotches);
        }
    }

    /// Whether there is a gauge where one is to vary, and a dumb-bell is pulled.
    fn check_gauge(&self, problems: &mut Vec<StudyError>) {
        let vary = &self.vary;
        let outline = &self.base.outline;
        for (field, interval) in [
            ("gauge_width_mm", vary.gauge_width_mm),
            ("gauge_length_mm", vary.gauge_length_mm),
            ("fillet_radius_mm", vary.fillet_radius_mm),
        ] {
            let Some(range) = interval else { continue };
            check_range(|| FieldPath::of("vary").name(field), range, problems);
            if !matches!(outline, Outline::Dumbbell(_)) {
                problems.push(StudyError::NoGauge { field, outline: outline.name() });
            }
        }
        if outline.dumbbell().is_some() && self.vary.tests.contains(&TestKind::DoubleLapShear) {
            problems.push(StudyError::DumbbellInShear);
        }
    }

    /// Whether designs can be searched for: besides what makes it a study, its base is driven as designs are. (A study
    /// may stand for more than a search, so that its base may be driven either way.)
    ///
    /// # Errors
    /// [`StudyError::BaseDrivenBackwards`].
    pub fn check_search(&self) -> Result<(), StudyError> {
        let drive_mm = self.base.largest_drive_mm();
        if drive_mm < 0.0 { Err(StudyError::BaseDrivenBackwards { drive_mm }) } else { Ok(()) }
    }
}

/// Kinds and angles of holes.
fn check_hole_shapes(shapes: &VaryHoleShapes, problems: &mut Vec<StudyError>) {
    let is_repeated = shapes.kinds.len() > 1 && shapes.kinds[1..].contains(&shapes.kinds[0]);
    if shapes.kinds.is_empty() || is_repeated {
        problems.push(StudyError::HoleKinds { count: shapes.kinds.len() });
    }
    let angles = &shapes.angle_deg;
    for (name, value, low) in [("min", angles.min, -MAX_HOLE_ANGLE_DEG), ("max", angles.max, angles.min)] {
        if !(value >= low && value <= MAX_HOLE_ANGLE_DEG) {
            let field = FieldPath::of("vary").name("hole_shapes").name("angle_deg").name(name);
            let allowed = format!("from {low} to {MAX_HOLE_ANGLE_DEG} degrees");
            problems.push(StudyError::OutOfRange { field, value, allowed });
        }
    }
}

fn check_range(path: impl Fn() -> FieldPath, range: Range, problems: &mut Vec<StudyError>) {
    let field = |end: &str| path().name(end);
    if !(MIN_LENGTH_MM..=MAX_LENGTH_MM).contains(&range.min) {
        let allowed = format!("positive, from {MIN_LENGTH_MM} to {MAX_LENGTH_MM} mm");
        problems.push(StudyError::OutOfRange { field: field("min"), value: range.min, allowed });
    }
    if !(range.max >= range.min && range.max <= MAX_LENGTH_MM) {
        let allowed = format!("at least its min, at most {MAX_LENGTH_MM} mm");
        problems.push(StudyError::OutOfRange { field: field("max"), value: range.max, allowed });
    }
}
