//! The files of scanners: DICOM and Bruker ParaVision.

mod dicom;
mod dicom_elements;
mod error;
mod jcamp;
mod paravision;
mod phase;
mod reader;
mod series;
mod stack;

pub use dicom::DicomFiles;
pub use error::{ScannerError, StackFault};
pub use paravision::ParavisionStudy;
pub use reader::{SeriesLine, VolumeReader};
pub use series::{PhaseSource, SeriesMap, SeriesStep, VolumeSource, raw_recording_from_series};
