//! What one scan tells about the material, by where its grid happens to lie: the table in
//! docs/design-study.md#where-the-grid-lies.
//!
//! The published block and blocks that are a little larger and smaller are scanned at random places of the grid, and at
//! its centred one; the last columns are the promise, which is to be the mean over all places.
//!
//! ```text
//! cargo run --release --example grid_places
//! ```

use lambdak::fem::{ForwardModel, ParameterSensitivity, SolveOptions};
use lambdak::material::Parameter;
use lambdak::prelude::*;
use lambdak::sensitivity::{FisherInformation, GridPlace, ScannedVoxels};
use lambdak::voxel::{Sampling, VoxelGrid, VoxelMask, VoxelOperator};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const DRIVE_MM: f64 = 7.0;
/// By how much the block's length and width differ from the published ones, mm.
const LARGER_MM: [f64; 5] = [0.0, 0.05, 0.1, 0.3, 0.5];
const NUM_PLACES: usize = 48;
const ELEMENT_SIZE: f64 = 1.6;

type Anything<T> = Result<T, Box<dyn std::error::Error>>;

/// A solved block in the scanner.
struct Scanned<'a> {
    specimen: &'a Specimen,
    model: &'a ForwardModel,
    material: &'a Material,
    scan: &'a ScanSettings,
    sensitivities: Vec<ParameterSensitivity>,
}

impl Scanned<'_> {
    /// What these voxels and the force tell.
    fn information(&self, mask: &VoxelMask, weights: &[f64]) -> Anything<FisherInformation> {
        let operator = VoxelOperator::new(self.specimen, self.model.mesh(), mask, Sampling::default())?;
        let averages = |s: &ParameterSensitivity| operator.average(&s.displacement);
        let fields = self.sensitivities.iter().map(averages).collect::<Result<Vec<_>, _>>()?;
        let forces_n: Vec<f64> = self.sensitivities.iter().map(|s| s.force_n).collect();
        Ok(FisherInformation::of_drive(self.material, &fields, weights, &forces_n, &self.scan.noise())?)
    }

    fn at(&self, place: GridPlace) -> Anything<FisherInformation> {
        let ScannedVoxels { mask, weights, .. } = ScanSettings { grid: place, ..*self.scan }.voxels(self.specimen)?;
        self.information(&mask, &weights)
    }

    /// The scan's grid moved by less than half a voxel along each axis.
    fn moved(&self, random: &mut ChaCha8Rng) -> Anything<FisherInformation> {
        let centred = VoxelGrid::covering(self.specimen, self.scan.voxel_mm)?;
        let edges = centred.voxel_mm;
        let origin_mm = [0, 1, 2].map(|a| centred.origin_mm[a] + (random.random_range(-0.5..0.5) - 1.0) * edges[a]);
        let mask =
            VoxelMask::of_specimen(self.specimen, VoxelGrid::new(origin_mm, edges, centred.shape.map(|n| n + 2))?)?;
        let weights = vec![1.0; mask.num_voxels()];
        self.information(&mask, &weights)
    }
}

/// Relative standard deviation of a parameter, %.
fn sd_percent(told: &FisherInformation, parameter: Parameter) -> Anything<f64> {
    let sd = told.covariance().relative_sd(told.index_of(parameter)?);
    Ok(100.0 * sd.unwrap_or(f64::NAN))
}

fn main() -> Anything<()> {
    let published = Specimen::from_json(include_str!("../geometries/two-hole-shear.json"))?;
    let one = Material::from_json(include_str!("../geometries/materials/ecoflex-0020.json"))?;
    let two = Material::from_json(include_str!("../geometries/materials/ecoflex-0020-two-term.json"))?;
    let scan = ScanSettings::default();
    println!(
        "Promised standard deviation of the last exponent, %, of {NUM_PLACES} random places of the grid and of others"
    );
    println!("material   larger by, mm   lowest   mean information   highest | centred   promise");
    for (name, material, parameter) in
        [("one term", &one, Parameter::Alpha(0)), ("two terms", &two, Parameter::Alpha(1))]
    {
        for larger_mm in LARGER_MM {
            let mut specimen = published.clone();
            specimen.block.length_mm += larger_mm;
            specimen.block.width_mm += larger_mm;
            let mesh = MeshOptions::graded(&specimen, ELEMENT_SIZE);
            let mut model = ForwardModel::of_specimen(&specimen, &mesh)?;
            let path = model.solve_path(material, &[DRIVE_MM], &SolveOptions::default(), &|| false)?;
            let sensitivities = model.tangent(material, &path[0])?.material_sensitivities()?;
            let scanned = Scanned { specimen: &specimen, model: &model, material, scan: &scan, sensitivities };
            let mut random = ChaCha8Rng::seed_from_u64(1);
            let mut sum = FisherInformation::none(material);
            let (mut lowest, mut highest) = (f64::INFINITY, 0.0_f64);
            for _ in 0..NUM_PLACES {
                let told = scanned.moved(&mut random)?;
                let sd = sd_percent(&told, parameter)?;
                (lowest, highest) = (lowest.min(sd), highest.max(sd));
                sum.add(&told)?;
            }
            // The information of one scan is this over the number of places.
            let mean = sd_percent(&sum, parameter)? * (NUM_PLACES as f64).sqrt();
            println!(
                "{name:<10} {larger_mm:13.2} {lowest:8.3} {mean:18.3} {highest:9.3} | {:7.3} {:9.3}",
                sd_percent(&scanned.at(GridPlace::Centred)?, parameter)?,
                sd_percent(&scanned.at(GridPlace::Anywhere)?, parameter)?
            );
        }
    }
    Ok(())
}
