//! How much a deformation tells about a material: pointwise and integrated sensitivities, Fisher information.

mod continuum;
mod covariance;
mod drives;
mod error;
mod evaluation;
mod information;
mod integrated;
mod joint_information;
mod observation;
mod pointwise;
mod protocol;
mod scan_settings;
mod separation;

pub use continuum::{
    ForceReading, ForceReadings, information_of_protocol, information_over_quadrature, integrate_over_quadrature,
    largest_principal_stretch, median_stretch_over_quadrature,
};
pub use covariance::{Covariance, Criterion, IDENTIFIABILITY_LIMIT, PromisedSd};
pub use drives::DriveSelection;
pub use error::EvaluationError;
pub use evaluation::{
    Evaluation, EvaluationMaps, EvaluationNotes, EvaluationOptions, EvaluationStatistics, ForceStep, Scanned, evaluate,
    evaluate_model, evaluate_scanned,
};
pub use information::{FisherInformation, InformationError, MeasurementNoise};
pub use integrated::{IntegratedSensitivity, integrate_over_voxels, parameter_sensitivity, sensitivity_map};
pub use observation::{DriveMaps, DrivenState, EvaluationStep, Observation, Scanner, Unknown, median};
pub use pointwise::{PointwiseSensitivity, alpha_sensitivity, mu_sensitivity};
pub use protocol::Protocol;
pub use scan_settings::{PartialVoxels, ScanSettings};
pub use separation::{MaterialState, Separation, separation_over_quadrature};
