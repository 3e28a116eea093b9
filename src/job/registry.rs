//! The registry of kinds: adding a kind of job adds one line here.

use super::kind::Kind;
use super::part::PartKind;

/// The kinds that this program runs.
pub static KINDS: [Kind; 19] = [
    Kind::of::<super::solve::SolveRequest>(),
    Kind::of::<super::evaluate::EvaluationRequest>(),
    Kind::of::<super::evaluation_list::EvaluationListRequest>(),
    Kind::of::<super::scan::ScanRequest>(),
    Kind::of::<super::import_request::ImportRequest>(),
    Kind::of::<super::calibrate::CalibrationRequest>(),
    Kind::of::<super::diagnose::DiagnosisRequest>(),
    Kind::of::<super::next::NextRequest>(),
    Kind::of::<super::load_curves::LoadCurvesRequest>(),
    Kind::of::<super::curves::CurvesRequest>(),
    Kind::of::<super::uniaxial::UniaxialRequest>(),
    Kind::of::<super::export_material::ExportMaterialRequest>(),
    Kind::of::<super::export_model::ExportModelRequest>(),
    Kind::of::<super::export_recording::ExportRecordingRequest>(),
    Kind::of::<crate::design::Study>(),
    Kind::of::<crate::sweep::SweepStudy>(),
    Kind::of::<super::compare::CompareRequest>(),
    Kind::of::<super::paper_tables::PaperTablesRequest>(),
    Kind::of::<super::proof::ProofRequest>(),
];

/// The kind whose command has this name.
pub fn kind_of_command(name: &str) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.command == name)
}

/// The kind with this name in the service's addresses.
pub fn kind_of_collection(name: &str) -> Option<&'static Kind> {
    KINDS.iter().find(|kind| kind.collection == name)
}

/// The kind of a sweep's tasks, which has no address of its own.
static SWEEP_TASK: Kind = Kind::of::<super::sweep_task::SweepTaskRequest>();
/// The kind of the evaluations in a list.
static EVALUATION: Kind = Kind::of::<super::evaluate::EvaluationRequest>();

/// The kind of a part.
pub fn kind_of_part(kind: PartKind) -> &'static Kind {
    match kind {
        PartKind::Evaluation => &EVALUATION,
        PartKind::SweepTask => &SWEEP_TASK,
    }
}

/// The kind of a stored task, which may be one that has no address.
pub fn kind_of_task(command: &str) -> Option<&'static Kind> {
    kind_of_command(command).or_else(|| Some(&SWEEP_TASK).filter(|kind| kind.command == command))
}
