//! Reads a result and takes out its figures and what makes it comparable.

use super::error::CompareError;
use super::figure::{Direction, Figure};
use crate::design::DesignResult;
use crate::file::{ReadError, read_json_text};
use crate::sensitivity::Evaluation;
use crate::sweep::{SweepCell, SweepResult};
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// Largest result that is read.
const MAX_BYTES: u64 = 1 << 30;

/// A result, ready to be compared.
#[derive(Clone, Debug, PartialEq)]
pub struct Subject {
    /// `evaluation/1`, `sweep/1` or `design/1`.
    pub schema: String,
    /// What must agree: name and value, in the order in which differences are told.
    pub conditions: Vec<(String, String)>,
    /// What must agree as well unless different inputs are wanted: the specimen and the mesh of it.
    pub inputs: Vec<(String, String)>,
    /// The figures.
    pub figures: Vec<Figure>,
    /// Whether the result itself says why a figure is missing: a task that fails has none.
    pub tells_of_failures: bool,
    /// Version of the program.
    pub version: String,
}

/// Reads `evaluation/1`, `sweep/1` or `design/1`.
///
/// # Errors
/// [`CompareError::Read`], [`CompareError::NotAResult`].
pub fn read(path: &Path) -> Result<Subject, CompareError> {
    let not = |message: String| CompareError::NotAResult { path: path.into(), message };
    let text = read_json_text(path, MAX_BYTES).map_err(|error| match error {
        ReadError::Io(error) => CompareError::Read { path: path.into(), message: error.to_string() },
        other => not(other.to_string()),
    })?;
    let value: Value = serde_json::from_str(&text).map_err(|e| not(e.to_string()))?;
    subject_of(path, &value)
}

/// The subject in `value`; `path` is for errors.
///
/// # Errors
/// [`CompareError::NotAResult`].
pub fn subject_of(path: &Path, value: &Value) -> Result<Subject, CompareError> {
    let not = |message: String| CompareError::NotAResult { path: path.into(), message };
    let Some(schema) = value.get("schema").and_then(Value::as_str) else {
        return Err(not("it has no schema".into()));
    };
    let subject = match schema {
        "evaluation/1" => Evaluation::deserialize(value).map(|e| of_evaluation(&e)),
        "design/1" => DesignResult::deserialize(value).map(|d| of_design(&d)),
        "sweep/1" => SweepResult::deserialize(value).map(|s| of_sweep(&s)),
        other => return Err(not(format!("its schema is '{other}'; known: evaluation/1, sweep/1, design/1"))),
    };
    subject.map_err(|e| not(format!("{schema} of another version: {e}")))
}

fn conditions_of(e: &Evaluation) -> Vec<(String, String)> {
    let scan = &e.scan;
    let forces_mm: Vec<f64> = e.force_steps.iter().map(|s| s.drive_mm).collect();
    let parameters: Vec<&str> = e.promised_sd.iter().map(|p| p.parameter.as_str()).collect();
    [
        (
            "what is seen",
            scan.surface
                .map_or_else(|| "the volume".into(), |s| format!("the face {}, {:?}", s.face.name(), s.components)),
        ),
        ("voxel size in mm", format!("{:?}", scan.voxel_mm)),
        ("noise of the displacement in mm", format!("{:?}", scan.noise_sd_mm)),
        ("noise of the force in N", format!("{}", scan.force_sd_n)),
        (
            "displacement per phase in mm/rad",
            scan.mm_per_radian.map_or_else(|| "not stated".into(), |s| format!("{s:?}")),
        ),
        ("weight of partly filled voxels", format!("{:?}", scan.partial_voxels)),
        ("where the scan's grid lies", format!("{:?}", scan.grid)),
        ("normalisation of the sensitivities", e.notes.integrated_sensitivity.clone()),
        ("meaning of the promised standard deviations", e.notes.promised_sd.clone()),
        ("parameters of the material", parameters.join(", ")),
        ("number of drives", e.steps.len().to_string()),
        ("number of blocks scanned", e.blocks_scanned.to_string()),
        ("shares of a scan's time", format!("{:?}", e.scan_share)),
        ("drives in mm at which the force alone is read", format!("{forces_mm:?}")),
    ]
    .map(|(name, value)| (name.to_string(), value))
    .into()
}

fn inputs_of(e: &Evaluation) -> Vec<(String, String)> {
    let s = &e.statistics;
    let drives: Vec<String> = e.steps.iter().map(|s| s.drive_mm.to_string()).collect();
    let voxels: Vec<String> = e.steps.iter().map(|s| s.num_voxels.to_string()).collect();
    let mesh = format!("{} elements, {} nodes, {} unknowns", s.num_elements, s.num_nodes, s.num_unknowns);
    vec![
        ("drives in mm".into(), drives.join(", ")),
        ("mesh".into(), mesh),
        ("number of voxels".into(), voxels.join(", ")),
        ("inputs (specimen, material, drives or settings): their hash".into(), e.input_hash.clone()),
    ]
}

fn of_evaluation(e: &Evaluation) -> Subject {
    let mut figures = Vec::new();
    figures_of("", e, &mut figures);
    Subject {
        schema: e.schema.clone(),
        conditions: conditions_of(e),
        inputs: inputs_of(e),
        figures,
        tells_of_failures: false,
        version: e.version.clone(),
    }
}

/// Figures of an evaluation, each name begun with `prefix`. Steps are numbered: their drives are among the inputs.
fn figures_of(prefix: &str, e: &Evaluation, figures: &mut Vec<Figure>) {
    let mut add = |name: String, value: Option<f64>, direction| {
        figures.push(Figure { name: format!("{prefix}{name}"), value, direction });
    };
    for (index, step) in e.steps.iter().enumerate() {
        let at = format!("step {}", index + 1);
        add(format!("{at}: force in N"), Some(step.force_n), Direction::Neutral);
        for (kind, force_n) in step.force_by_kind_n.iter().enumerate() {
            add(format!("{at}: force of sample {} in N", kind + 1), Some(*force_n), Direction::Neutral);
        }
        add(format!("{at}: median stretch"), Some(step.median_stretch), Direction::Neutral);
        for s in &step.integrated_sensitivity {
            let p = &s.parameter;
            let of = |what: &str| format!("{at}: integrated sensitivity to {p}, {what}");
            add(of("sum"), Some(s.sum), Direction::LargerIsBetter);
            add(of("mean per voxel"), Some(s.mean_per_voxel), Direction::LargerIsBetter);
            match s.surface_integral {
                Some(integral) => add(of("surface integral"), Some(integral), Direction::LargerIsBetter),
                None => add(of("volume integral"), Some(s.volume_integral), Direction::LargerIsBetter),
            }
        }
        for p in &step.promised_sd {
            add(format!("{at}: promised sd of {}", p.parameter), p.value, Direction::SmallerIsBetter);
        }
    }
    for p in &e.promised_sd {
        add(format!("all drives: promised sd of {}", p.parameter), p.value, Direction::SmallerIsBetter);
    }
}

fn of_design(d: &DesignResult) -> Subject {
    let mut figures = vec![
        Figure {
            name: "objective of the best design".into(),
            value: Some(d.best.objective),
            direction: Direction::LargerIsBetter,
        },
        Figure {
            name: "designs confirmed within the limits".into(),
            value: Some(d.ranked.iter().filter(|r| r.is_within_limits).count() as f64),
            direction: Direction::Neutral,
        },
    ];
    let mut conditions =
        vec![("objective".into(), format!("{:?}", d.objective)), ("base specimen".into(), d.base.specimen.to_json())];
    conditions.push(("protocol".into(), format!("{:?}", d.protocol)));
    for (label, entry) in [("base", &d.base), ("best", &d.best)] {
        for m in &entry.by_material {
            let prefix = format!("{label}, material \"{}\": ", m.material);
            figures_of(&prefix, &m.evaluation, &mut figures);
            let named = conditions_of(&m.evaluation).into_iter().map(|(name, v)| (format!("{prefix}{name}"), v));
            conditions.extend(named);
        }
    }
    // The mesh and voxels of the best design follow from it; those of the base must be the same.
    for m in &d.base.by_material {
        let named = inputs_of(&m.evaluation).into_iter();
        conditions.extend(named.map(|(name, v)| (format!("base, material \"{}\": {name}", m.material), v)));
    }
    let spread = |label: &str, list: &[crate::calibration::ParameterSpread], figures: &mut Vec<Figure>| {
        figures.extend(list.iter().map(|p| Figure {
            name: format!("verification of the {label}: sd found of {}", p.parameter),
            value: Some(p.found_sd),
            direction: Direction::SmallerIsBetter,
        }));
    };
    spread("best", &d.verification.best, &mut figures);
    spread("base", &d.verification.base, &mut figures);
    Subject {
        schema: d.schema.clone(),
        conditions,
        inputs: Vec::new(),
        figures,
        tells_of_failures: false,
        version: d.version.clone(),
    }
}

/// Direction of a column of a sweep's table; none where it is no figure.
fn direction_of(column: &str) -> Option<Direction> {
    if column.starts_with("sensitivity_") {
        return Some(Direction::LargerIsBetter);
    }
    if column.starts_with("promised_sd_") {
        return Some(Direction::SmallerIsBetter);
    }
    ["force_n", "median_stretch"].contains(&column).then_some(Direction::Neutral)
}

fn of_sweep(s: &SweepResult) -> Subject {
    let study = &s.study;
    let text = |value: &Value| value.to_string();
    let json = |value: serde_json::Result<Value>| value.as_ref().map_or_else(|_| String::new(), text);
    let conditions = vec![
        ("base specimen".into(), json(serde_json::to_value(&study.base))),
        ("scan".into(), json(serde_json::to_value(study.scan))),
        ("materials".into(), json(serde_json::to_value(&study.materials))),
        ("variables".into(), json(serde_json::to_value(&study.variables))),
        ("sampling".into(), format!("{} (seed {})", json(serde_json::to_value(&study.sampling)), study.seed)),
        ("mesh".into(), json(serde_json::to_value(study.mesh))),
        ("columns".into(), s.columns.join(", ")),
    ];
    let index_of = |name: &str| s.columns.iter().position(|c| c == name);
    let cell = |row: &[SweepCell], name: &str| -> String {
        match index_of(name).and_then(|i| row.get(i)) {
            Some(SweepCell::Integer(v)) => v.to_string(),
            Some(SweepCell::Text(v)) => v.clone(),
            _ => "-".into(),
        }
    };
    let mut figures = Vec::new();
    for row in &s.rows {
        let task = cell(row, "task");
        let is_done = cell(row, "status") == "done";
        // A task that fails now is worse than any number.
        if ["0", "-"].contains(&cell(row, "step").as_str()) {
            figures.push(Figure {
                name: format!("task {task}: done"),
                value: is_done.then_some(1.0),
                direction: Direction::LargerIsBetter,
            });
        }
        let at = format!("task {task}, step {}", cell(row, "step"));
        for (column, value) in s.columns.iter().zip(row) {
            let (Some(direction), true) = (direction_of(column), is_done) else { continue };
            let value = match value {
                SweepCell::Number(v) => Some(*v),
                SweepCell::Integer(v) => Some(*v as f64),
                _ => None,
            };
            figures.push(Figure { name: format!("{at}: {column}"), value, direction });
        }
    }
    Subject {
        schema: s.schema.clone(),
        conditions,
        inputs: Vec::new(),
        figures,
        tells_of_failures: true,
        version: s.version.clone(),
    }
}
