//! The outcome of a diagnosis, with everything that reports and later work need.

use super::cause_fit::CauseFit;
use super::found::FoundCause;
use super::interior::InteriorTest;
use super::leftover::Leftover;
use super::load_history::LoadHistoryFit;
use super::maps::ScoreMap;
use super::mesh_error::MeshDefect;
use super::prior::FitSettings;
use super::ranked::Ranked;
use crate::calibration::Observed;
use crate::material::Material;
use crate::rate::Verdict;

/// The diagnosis of a recording.
pub struct Diagnosis {
    /// How it ended.
    pub verdict: Verdict,
    /// Causes, the one with the most evidence first.
    pub causes: Vec<FoundCause>,
    /// What the data cannot tell apart from them; where the verdict is unexplained, what was tried and does not explain
    /// it.
    pub alternatives: Vec<FoundCause>,
    /// The nominal model's fit.
    pub nominal: CauseFit,
    /// With the causes.
    pub corrected: CauseFit,
    /// What each leaves.
    pub left: [Leftover; 2],
    /// Rms misfit (mm) on voxel blocks kept back, without and with the causes; `None` where a fit to half of the blocks
    /// has no equilibrium.
    pub kept_back_rms_mm: Option<[f64; 2]>,
    /// All causes looked at.
    pub ranked: Vec<Ranked>,
    /// The load curve.
    pub load: Option<LoadHistoryFit>,
    /// Maps of the nominal misfit.
    pub maps: Vec<(String, ScoreMap)>,
    /// The material as believed.
    pub believed: Option<Material>,
    /// Priors and stops of the last fits.
    pub settings: FitSettings,
    /// The recording as compared.
    pub observed: Observed,
    /// Displacement unknowns of the model.
    pub num_unknowns: usize,
    /// Equilibria solved.
    pub num_solves: usize,
    /// The allowance in use, mm.
    pub allowance_mm: f64,
    /// Variance (mm²) of each component at every voxel for what the model is known to leave; zero where it is taken to
    /// be exact.
    pub discrepancy_mm2: [f64; 3],
    /// What a finer mesh predicts beyond the mesh of the diagnosis, the causes included.
    pub mesh_defect: Option<MeshDefect>,
    /// Whether the misfit was made at the boundary or inside; `None` where there is none or the test cannot be made.
    pub interior: Option<InteriorTest>,
}
