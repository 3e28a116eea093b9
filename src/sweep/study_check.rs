//! Which rules a sweep study violates.

use super::column_names::is_reserved;
use super::study::{MAX_TASKS, Sampling, SweepStudy, SweepVariable};
use super::study_error::SweepStudyError;
use super::target::Target;
use crate::field::{FieldError, FieldPath};
use crate::mesh::{MeshSize, SIZE_FACTORS};

/// A violated rule and where.
type Problem = (FieldPath, SweepStudyError);

impl SweepStudy {
    /// Checks a study and all of its parts.
    ///
    /// # Errors
    /// [`SweepStudyError`]: the first problem found.
    pub fn validate(&self) -> Result<(), SweepStudyError> {
        self.problems().into_iter().next().map_or(Ok(()), |(_, error)| Err(error))
    }

    /// Every rule that the study violates, with pointers into it.
    pub fn field_errors(&self) -> Vec<FieldError> {
        let base = self.base.field_errors().into_iter().map(|e| e.below("/base"));
        let materials = self.materials.iter().enumerate().flat_map(|(index, m)| {
            let errors = m.material.field_errors().into_iter();
            errors.map(move |e| e.below(&format!("/materials/{index}/material")))
        });
        let is_of_a_part =
            |e: &SweepStudyError| matches!(e, SweepStudyError::Base(_) | SweepStudyError::Material { .. });
        let own = self.problems().into_iter().filter(|(_, e)| !is_of_a_part(e)).map(|(path, e)| e.field_error(&path));
        base.chain(materials).chain(own).collect()
    }

    /// Every rule that the study violates; of the base and each material the first one.
    fn problems(&self) -> Vec<Problem> {
        let mut problems = Vec::new();
        let root = FieldPath::of;
        problems.extend(self.base.validate().err().map(|e| (root("base"), SweepStudyError::Base(e))));
        self.check_materials(&mut problems);
        problems.extend(self.scan.field_errors().into_iter().map(|e| (root("scan"), SweepStudyError::Scan(e))));
        let remedy = "a sweep is of scans of the volume; give a list of evaluations for cameras";
        problems.extend(self.scan.needs_volume(remedy).err().map(|e| (root("scan"), SweepStudyError::Scan(e))));
        if let MeshSize::Factor(value) = self.mesh
            && !SIZE_FACTORS.contains(&value)
        {
            let [low, high] = [SIZE_FACTORS.start(), SIZE_FACTORS.end()];
            let allowed = format!("search, standard, fine or a size factor from {low} to {high}");
            problems.push((root("mesh"), SweepStudyError::OutOfRange { field: root("mesh"), value, allowed }));
        }
        for index in 0..self.variables.len() {
            self.check_variable(index, &mut problems);
        }
        self.check_targets_differ(&mut problems);
        self.check_sampling(&mut problems);
        let count = self.num_tasks();
        if !(1..=MAX_TASKS).contains(&count) {
            problems.push((root("sampling"), SweepStudyError::NumTasks { count, limit: MAX_TASKS }));
        }
        problems
    }

    fn check_materials(&self, problems: &mut Vec<Problem>) {
        let list = || FieldPath::of("materials");
        if self.materials.is_empty() {
            problems.push((list(), SweepStudyError::NoMaterials));
        }
        for (index, m) in self.materials.iter().enumerate() {
            if let Err(error) = m.material.validate() {
                let path = list().index(index).name("material");
                problems.push((path, SweepStudyError::Material { name: m.name.clone(), error }));
            }
            if self.materials[..index].iter().any(|other| other.name == m.name) {
                problems.push((list().index(index).name("name"), SweepStudyError::SameName { name: m.name.clone() }));
            }
        }
    }

    fn check_variable(&self, index: usize, problems: &mut Vec<Problem>) {
        let v = &self.variables[index];
        let path = || FieldPath::of("variables").index(index);
        let bad = |problem| SweepStudyError::BadName { variable: v.name.clone(), problem };
        if v.name.is_empty() || !v.name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_') {
            problems.push((path().name("name"), bad("a name consists of letters, digits and underscores")));
        }
        if is_reserved(&v.name) {
            problems.push((path().name("name"), bad("the table has a column of this name already")));
        }
        if self.variables[..index].iter().any(|other| other.name == v.name) {
            problems.push((path().name("name"), bad("another variable has the same name")));
        }
        if v.sets.is_empty() {
            problems.push((path().name("sets"), bad("sets is empty; name what the value goes to")));
        }
        for (number, text) in v.sets.iter().enumerate() {
            let at = || path().name("sets").index(number);
            match Target::parse(&v.name, text) {
                Ok(target) => self.check_target(index, text, target, at, problems),
                Err(unknown) => problems.push((at(), unknown)),
            }
        }
        self.check_values(index, problems);
    }

    fn check_target(
        &self,
        index: usize,
        text: &str,
        target: Target,
        at: impl Fn() -> FieldPath,
        problems: &mut Vec<Problem>,
    ) {
        let v = &self.variables[index];
        for m in &self.materials {
            let (mut specimen, mut material, mut scan) = (self.base.clone(), m.material.clone(), self.scan);
            if !target.set(1.0, &mut specimen, &mut material, &mut scan) {
                let error = SweepStudyError::NoSuchPlace {
                    variable: v.name.clone(),
                    target: text.into(),
                    num_holes: self.base.holes.len(),
                    material: m.name.clone(),
                    num_terms: m.material.terms.len(),
                };
                problems.push((at(), error));
                break;
            }
        }
        let suffix = target.unit_suffix();
        if !v.name.ends_with(suffix) {
            let path = FieldPath::of("variables").index(index).name("name");
            let (variable, target) = (v.name.clone(), text.into());
            problems.push((path, SweepStudyError::MissingUnit { variable, target, suffix }));
        }
        if target.is_of_scan() {
            for (path, value) in self.values_of(index) {
                let set = target.signed(value);
                if set.is_finite() && set <= 0.0 {
                    let allowed = if target.signed(1.0) > 0.0 { "above 0" } else { "below 0, as it is negated" }.into();
                    problems.push((path.clone(), SweepStudyError::OutOfRange { field: path, value, allowed }));
                }
            }
        }
    }

    /// The values that a variable is given and where they stand: its list, the ends of its range, its column of rows.
    fn values_of(&self, index: usize) -> Vec<(FieldPath, f64)> {
        let v = &self.variables[index];
        let path = || FieldPath::of("variables").index(index);
        let listed = v.values.iter().flatten().enumerate().map(|(n, x)| (path().name("values").index(n), *x));
        let ends = v.range.into_iter().flat_map(|r| [("min", r.min), ("max", r.max)]);
        let mut all: Vec<_> = listed.chain(ends.map(|(end, x)| (path().name("range").name(end), x))).collect();
        if let Sampling::List { rows } = &self.sampling {
            let cell = |row: usize| FieldPath::of("sampling").name("rows").index(row).index(index);
            all.extend(rows.iter().enumerate().filter_map(|(n, row)| row.get(index).map(|x| (cell(n), *x))));
        }
        all
    }

    fn check_values(&self, index: usize, problems: &mut Vec<Problem>) {
        let v = &self.variables[index];
        let path = || FieldPath::of("variables").index(index);
        let is_infinite = |(_, value): &(FieldPath, f64)| !value.is_finite();
        for (path, value) in self.values_of(index).into_iter().filter(is_infinite) {
            problems.push((path.clone(), SweepStudyError::OutOfRange { field: path, value, allowed: "finite".into() }));
        }
        if let Some(r) = v.range
            && r.min > r.max
        {
            let error = SweepStudyError::EmptyRange { variable: v.name.clone(), min: r.min, max: r.max };
            problems.push((path().name("range").name("min"), error));
        }
        if let Some((sampling, needed)) = self.sampling.missing_of(v) {
            let error = SweepStudyError::MissingValues { variable: v.name.clone(), sampling, needed };
            problems.push((path(), error));
        }
    }

    /// No number is set twice: the last variable would win and the others be without effect.
    fn check_targets_differ(&self, problems: &mut Vec<Problem>) {
        let mut known: Vec<(Target, &str)> = Vec::new();
        for (index, v) in self.variables.iter().enumerate() {
            for (number, text) in v.sets.iter().enumerate() {
                let Ok(target) = Target::parse(&v.name, text) else { continue };
                if let Some((_, other)) = known.iter().find(|(earlier, _)| earlier.is_same_place(&target)) {
                    let path = FieldPath::of("variables").index(index).name("sets").index(number);
                    let (variable, target) = (v.name.clone(), text.clone());
                    problems.push((path, SweepStudyError::SameTarget { variable, target, other: (*other).into() }));
                }
                known.push((target, &v.name));
            }
        }
    }

    fn check_sampling(&self, problems: &mut Vec<Problem>) {
        let path = || FieldPath::of("sampling");
        match &self.sampling {
            Sampling::LatinHypercube { count: 0 } => {
                let field = path().name("count");
                problems.push((
                    field.clone(),
                    SweepStudyError::OutOfRange { field, value: 0.0, allowed: "at least 1".into() },
                ));
            }
            Sampling::List { rows } => {
                let expected = self.variables.len();
                for (row, values) in rows.iter().enumerate().filter(|(_, values)| values.len() != expected) {
                    let error = SweepStudyError::RowLength { row, found: values.len(), expected };
                    problems.push((path().name("rows").index(row), error));
                }
            }
            _ => {}
        }
    }
}

impl Sampling {
    /// What a variable lacks or has too much of for this sampling: the sampling's name and what it needs.
    fn missing_of(&self, v: &SweepVariable) -> Option<(&'static str, &'static str)> {
        match self {
            Sampling::Grid {} if v.values.is_some() == v.range.is_some() => {
                Some(("grid", "either values or a range with a count"))
            }
            Sampling::Grid {} if v.grid_len() == 0 => Some(("grid", "at least one value (range: a count)")),
            Sampling::LatinHypercube { .. } if v.range.is_none() || v.values.is_some() => {
                Some(("latin_hypercube", "a range, and no values"))
            }
            Sampling::LatinHypercube { .. } if v.range.is_some_and(|r| r.count.is_some()) => {
                Some(("latin_hypercube", "a range without a count (the sampling has it)"))
            }
            Sampling::List { .. } if v.values.is_some() || v.range.is_some() => {
                Some(("list", "neither values nor a range (the rows have them)"))
            }
            _ => None,
        }
    }
}
