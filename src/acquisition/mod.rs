//! The scanner: from a field of displacement to complex images, and back. Cameras that see a face: [`film()`].
//!
//! Forward: the finite elements' displacement u(X) is seen by each voxel as the mean of exp(i uₐ/sₐ) over its material
//! (sₐ: mm per radian of direction a), so that a strong gradient inside a voxel lowers the magnitude; complex Gaussian
//! noise is added, the images may lose the edge of k-space, and only wrapped phases and magnitudes are kept
//! ([`scan()`]).
//!
//! Backward: phases are unwrapped in three dimensions ([`unwrap`]), the whole multiple of 2π is fixed at the plate
//! that does not move, the noise of each voxel follows from its magnitude, and voxels whose multiple of 2π is not
//! certain are left out and counted ([`reconstruct()`]).

mod anchor;
mod cameras;
mod driven;
mod error;
mod filter;
mod kspace;
mod loading;
mod noise;
mod reconstruct;
mod result;
mod scan;
mod signal;
pub mod unwrap;

#[cfg(test)]
mod scan_tests;

pub use anchor::{Anchor, AnchorReport};
pub use cameras::{CameraOptions, Filmed, film};
pub use error::AcquisitionError;
pub use filter::{FilteredField, hamming_filtered};
pub use kspace::{KSpace, Window};
pub use loading::{LoadProgram, loading_history};
pub use noise::{NoiseEstimate, NoiseSource};
pub use reconstruct::{ComponentReport, ReconstructOptions, Reconstruction, StepReport, reconstruct};
pub use result::{ErrorReport, ScanResult, ScanStep, SettingsOfScan};
pub use scan::{Scan, ScanOptions, noisy_images, scan};
pub use signal::{Complex, signal_images};
