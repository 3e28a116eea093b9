//! How much a deformation tells about a material: pointwise and integrated sensitivities, Fisher information.

mod continuum;
mod covariance;
mod detectable_size;
mod discretisation;
mod drives;
mod encoding;
mod error;
mod evaluation;
mod evaluation_options;
mod evaluation_result;
mod fixture;
mod information;
mod integrated;
mod joint_information;
mod observation;
mod pointwise;
mod protocol;
mod scan_settings;
mod separation;
mod shares;

pub use continuum::{
    ForceReading, ForceReadings, ScannedBlock, information_of_protocol, information_over_quadrature,
    integrate_over_blocks, integrate_over_quadrature, largest_principal_stretch, median_stretch_over_quadrature,
};
pub use covariance::{Covariance, Criterion, IDENTIFIABILITY_LIMIT, PromisedSd};
pub use detectable_size::{DetectableSize, DetectionLimit};
pub use discretisation::bound_discretisation;
pub use drives::DriveSelection;
#[cfg(feature = "calibration")]
pub(crate) use encoding::{Encoding, MAX_PHASE_SD, MIN_MARGIN};
pub use error::EvaluationError;
pub use evaluation::{EvaluationMaps, SampleMaps, evaluate, evaluate_fixture, unknowns_of};
pub use evaluation_options::EvaluationOptions;
pub use evaluation_result::{Evaluation, EvaluationNotes, EvaluationStatistics, ForceStep};
pub use fixture::{Fixture, Part};
pub use information::{FisherInformation, InformationError, MeasurementNoise};
pub use integrated::{IntegratedSensitivity, integrate_over_voxels, parameter_sensitivity, sensitivity_map};
pub use joint_information::{JointInformation, NuisanceColumn};
pub use observation::{DriveMaps, DrivenState, EvaluationStep, Observation, PhaseLoss, Scanner, Unknown, median};
pub use pointwise::{PointwiseSensitivity, alpha_sensitivity, mu_sensitivity};
pub use protocol::{Protocol, ProtocolMismatch};
pub use scan_settings::{GridPlace, PartialVoxels, ScanSettings, ScannedVoxels};
pub use separation::{MaterialState, Separation, separation_over_quadrature};
pub use shares::{BestShares, SharedTime, best_shares};
