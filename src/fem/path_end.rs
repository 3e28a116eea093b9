//! What ends a path of equilibria: the sample, its material, the mesh or the method.
//!
//! An equilibrium is stable while its tangent K is positive definite. How far it is from losing that is told by the
//! least eigenvalue ν of K φ = ν K₀ φ, with K₀ the tangent at rest: it is 1 at rest, whatever the units, the specimen
//! and the mesh, and falls to zero where the sample gives way along φ without more force. At a limit point the path
//! turns back and no equilibrium lies beyond; at a bifurcation another path branches off (buckling, or wrinkles of a
//! free face; Biot 1963). How ν falls tells them apart: before the drive d at which a path turns back its states are
//! smooth functions of √(d − drive), and so is ν; through a bifurcation the path runs on smoothly in the drive, and ν
//! with it (Wriggers & Simo, Int. J. Numer. Meth. Engng 30 (1990) 155).
//!
//! ν and φ are found by inverse iteration with K + s K₀, which is positive definite also where K has just ceased to be.

use super::assembler::{Assembler, Configuration};
use super::dot::dot;
use super::equilibrium::Equilibrium;
use super::error::{SolveError, StepFailure};
use super::forward_model::ForwardModel;
use super::linearisation::Linearisation;
use super::mesh_model::MeshModel;
use super::options::SolveOptions;
use crate::material::{Material, relative_stiffness};
use std::fmt;

/// Smallest step on the last part of the way, as a fraction of the drive: what stands still in such steps has ended.
const SMALLEST_STEP: f64 = 1.0 / 2048.0;

/// What of a drive that was reached is reached again in other steps.
const WITHIN_REACH: f64 = 0.999;

/// How often a drive a little before the last one reached is tried.
const TRIES: usize = 3;

/// s: small beside 1, and large beside what a factor in single precision gets wrong. Where K + s K₀ is not positive
/// definite either, larger ones are tried.
const SHIFTS: [f64; 3] = [0.02, 0.1, 0.5];

/// Steps of the inverse iteration. Near an instability each brings the error down to a part of s.
const ITERATIONS: usize = 12;

/// ν below which a sample counts as unstable. Before a limit point it falls as the square root of the way that is left
/// (times a number of the order of one), of which steps and [`WITHIN_REACH`] leave up to 0.002: √0.002 is 0.045.
const UNSTABLE_BELOW: f64 = 0.1;

/// Accuracy of the linear solutions: an eigenvalue has the square of its vector's error.
const ACCURACY: f64 = 1e-5;

/// Parts of the way at which ν is looked at beside the end: near enough for its law to be that of the end, and far
/// enough apart for a square root to be told from a line.
const BEFORE_END: [f64; 2] = [0.94, 0.98];

/// Why a path ended.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum EndCause {
    /// The material gives way: a point of it is unstable in Hill's sense.
    Material {
        /// Its smallest stiffness over its initial shear modulus; 2 at rest.
        relative_stiffness: f64,
        /// Where it was at rest, mm.
        place_mm: [f64; 3],
    },
    /// The meshed sample gives way as a structure, though no point of its material does. Large elements do so at
    /// stretches that the sample itself bears: a finer mesh tells.
    Sample {
        /// ν, the least stiffness over that at rest; 1 at rest.
        least_stiffness: f64,
        /// Where it gives way most, as it was at rest, mm.
        place_mm: [f64; 3],
        /// Whether the path turns back (a limit point); else another path branches off.
        is_limit_point: bool,
        /// Whether smaller steps follow the sample to the drive asked for once it has given way.
        goes_on: bool,
    },
    /// An element folds although the sample is stable: the mesh is too coarse for the deformation there. On no path
    /// that was tried: elements give way first, and the meshed sample with them ([`EndCause::Sample`]).
    Mesh {
        /// Element index.
        element: usize,
        /// ν at the last equilibrium.
        least_stiffness: f64,
    },
    /// Neither: with smaller steps the path goes on, or Newton's method fails for a reason that is not known.
    Method {
        /// ν at the last equilibrium.
        least_stiffness: f64,
        /// What stopped the last attempt; nothing where smaller steps reach the drive asked for.
        failure: Option<StepFailure>,
    },
}

/// What moves the plate along a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// The drive.
    Drive,
    /// The precompression, before any drive.
    Precompression,
}

impl fmt::Display for Way {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Way::Drive => "drive",
            Way::Precompression => "precompression",
        })
    }
}

/// Where a path ended and why.
#[derive(Clone, Debug)]
pub struct PathEnd {
    /// What moved the plate.
    pub way: Way,
    /// How far at the last equilibrium in small steps, mm.
    pub reached_mm: f64,
    /// Why there is none beyond.
    pub cause: EndCause,
}

impl fmt::Display for PathEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reached = self.reached_mm;
        let (there, reduce) = match self.way {
            Way::Drive => (format!("at {reached:.2} mm"), "reduce the drive"),
            Way::Precompression => {
                (format!("at a precompression of {reached:.2} mm"), "change precompression_mm towards 0")
            }
        };
        let at = |[x, y, z]: [f64; 3]| format!("({x:.1}, {y:.1}, {z:.1}) mm");
        match &self.cause {
            EndCause::Material { place_mm, .. } => {
                write!(
                    f,
                    "{there} the material is unstable at {}; {reduce} or use a material that is stable there",
                    at(*place_mm)
                )
            }
            EndCause::Sample { least_stiffness, place_mm, is_limit_point, goes_on } => {
                let how = match (is_limit_point, goes_on) {
                    (_, true) => "it buckles or wrinkles, and only smaller load steps would follow that",
                    (true, false) => "no equilibrium lies beyond",
                    (false, false) => "it buckles or wrinkles",
                };
                write!(
                    f,
                    "{there} the sample itself becomes unstable at {} (its least stiffness is {least_stiffness:.3} \
                     of that at rest): {how}; {reduce}, make it stouter there, or refine the mesh, of which a coarse one \
                     gives way before the sample does",
                    at(*place_mm)
                )
            }
            EndCause::Mesh { element, .. } => {
                write!(f, "{there} element {element} folds although the sample is stable; {reduce} or refine the mesh")
            }
            EndCause::Method { failure: None, .. } => {
                write!(f, "smaller load steps than those tried go on; {reduce} or try another mesh")
            }
            EndCause::Method { failure: Some(failure), .. } => {
                write!(f, "{there} neither sample nor mesh gives way ({failure}); {reduce} or try another mesh")
            }
        }
    }
}

impl ForwardModel {
    /// Why plates came to a precompression of `reached_mm` and no further on the way to `asked_mm`
    /// ([`SolveError::NotPrecompressed`]): [`ForwardModel::path_end`] with the precompression in place of the drive.
    ///
    /// # Errors
    /// As [`ForwardModel::path_end`].
    pub fn precompression_end(
        &self,
        material: &Material,
        reached_mm: f64,
        asked_mm: f64,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<PathEnd, SolveError> {
        let end = self.pressing().path_end(material, reached_mm, asked_mm, is_cancelled)?;
        Ok(PathEnd { way: Way::Precompression, ..end })
    }

    /// Why a path that stopped at `reached_mm` on the way to `asked_mm` ([`SolveError::Diverged`]) did so. It is
    /// followed in ever smaller steps first, which takes about as long as a dozen solutions.
    ///
    /// # Errors
    /// [`SolveError`] where not even the way to `reached_mm` is found again, or on cancellation.
    pub fn path_end(
        &mut self,
        material: &Material,
        reached_mm: f64,
        asked_mm: f64,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<PathEnd, SolveError> {
        let small = SolveOptions { min_step: SMALLEST_STEP, ..SolveOptions::default() };
        let usual = SolveOptions::default();
        let mut before: Vec<Equilibrium> = Vec::new();
        for part in BEFORE_END {
            before.push(self.as_far_as(material, part * reached_mm, before.last(), &usual, is_cancelled)?);
        }
        let mut last = self.as_far_as(material, reached_mm, before.last(), &usual, is_cancelled)?;
        let failure = match self.solve(material, asked_mm, Some(&last), &small, is_cancelled) {
            Ok(_) => None,
            Err(SolveError::Diverged { reached_mm, cause, .. }) => {
                last = self.as_far_as(material, reached_mm, Some(&last), &small, is_cancelled)?;
                Some(cause)
            }
            Err(other) => return Err(other),
        };
        let mode = self.fine.softest(material, &last)?;
        let (relative_stiffness, place_mm) = self.weakest_point(material, &last);
        let least_stiffness = mode.stiffness;
        let cause = match failure {
            _ if relative_stiffness < 0.0 => EndCause::Material { relative_stiffness, place_mm },
            failure if least_stiffness < UNSTABLE_BELOW => {
                let mut seen: Vec<(f64, f64)> = Vec::new();
                for state in &before {
                    seen.push((state.drive_mm, self.fine.softest(material, state)?.stiffness));
                }
                EndCause::Sample {
                    least_stiffness,
                    place_mm: mode.place_mm,
                    is_limit_point: falls_as_square_root(seen[0], seen[1], (last.drive_mm, least_stiffness)),
                    goes_on: failure.is_none(),
                }
            }
            Some(StepFailure::InvertedElement { element, .. }) => EndCause::Mesh { element, least_stiffness },
            failure => EndCause::Method { least_stiffness, failure },
        };
        Ok(PathEnd { way: Way::Drive, reached_mm: last.drive_mm, cause })
    }

    /// The equilibrium at a drive, or the last one on the way there that is found again.
    ///
    /// # Errors
    /// As [`ForwardModel::solve`].
    fn as_far_as(
        &mut self,
        material: &Material,
        drive_mm: f64,
        start: Option<&Equilibrium>,
        options: &SolveOptions,
        is_cancelled: &(dyn Fn() -> bool + Sync),
    ) -> Result<Equilibrium, SolveError> {
        let mut found = self.solve(material, drive_mm, start, options, is_cancelled);
        for _ in 0..TRIES {
            match found {
                // Other steps than those that led there may end a little earlier.
                Err(SolveError::Diverged { reached_mm, .. }) => {
                    found = self.solve(material, reached_mm * WITHIN_REACH, start, options, is_cancelled);
                }
                _ => break,
            }
        }
        found
    }

    /// The smallest stiffness of the material over its initial shear modulus, and where at rest.
    fn weakest_point(&self, material: &Material, at: &Equilibrium) -> (f64, [f64; 3]) {
        let points = self.quadrature_fields(material, at);
        let of_point = |q: &super::QuadraturePoint| (relative_stiffness(material, &q.deformation_gradient), q.position);
        points.iter().map(of_point).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, [0.0; 3]))
    }
}

/// Whether ν, seen at three drives of which the last is the end of a path, falls there as the square root of the way
/// that is left (ν² then lies on a line) rather than on a line itself.
fn falls_as_square_root(first: (f64, f64), second: (f64, f64), end: (f64, f64)) -> bool {
    let on_line = |a: f64, b: f64| a + (b - a) * (end.0 - first.0) / (second.0 - first.0);
    let line = on_line(first.1, second.1);
    let root = on_line(first.1.powi(2), second.1.powi(2)).max(0.0).sqrt();
    // Beyond a point where it turns back a path has no states, so that none has a negative ν.
    end.1 > 0.0 && (end.1 - root).abs() < (end.1 - line).abs()
}

/// How a sample gives way most easily.
struct Softest {
    /// ν.
    stiffness: f64,
    /// Where at rest φ is largest, mm.
    place_mm: [f64; 3],
}

impl MeshModel {
    /// The least eigenvalue of the tangent at `state` over that at rest.
    ///
    /// # Errors
    /// [`SolveError`].
    fn softest(&self, material: &Material, state: &Equilibrium) -> Result<Softest, SolveError> {
        let assembler = &self.assembler;
        let mesh = assembler.mesh();
        let assembled = |state: &Equilibrium| {
            let mut there = Linearisation::new(self.linearisation.system.empty_like());
            let done = assembler.linearise(material, state, &mut there);
            done.map(|()| there.system).map_err(|cause| SolveError::diverged_at(state.drive_mm, cause))
        };
        let at_rest = assembled(&Equilibrium::at_rest(mesh.nodes.len(), mesh.num_elements()))?;
        let tangent = assembled(state)?;
        let with_shift = |shift: f64| {
            let mut shifted = tangent.share();
            shifted.add(shift, &at_rest);
            shifted.factorise().map(|()| shifted)
        };
        let [first, others @ ..] = SHIFTS;
        let mut shifted = others.iter().fold(with_shift(first), |made, &shift| made.or_else(|_| with_shift(shift)))?;
        // Any start that no symmetry excludes will do: the path's direction and one that has none of its symmetries.
        let path = path_direction(assembler, material, state)?;
        let scatter = |k: usize| ((k as f64 * 0.618_033_988_75).fract() - 0.5) / mesh.nodes.len() as f64;
        let start: Vec<[f64; 3]> =
            (0..mesh.nodes.len()).map(|v| [0, 1, 2].map(|i| path[v][i] + scatter(3 * v + i))).collect();
        let mut mode = assembler.collect(&start, 1.0);
        let mut stiffness = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let right = at_rest.times(&mode);
            mode = shifted.solve(&[right], ACCURACY)?.swap_remove(0);
            let scale = dot(&mode, &at_rest.times(&mode)).sqrt();
            mode.iter_mut().for_each(|x| *x /= scale);
            stiffness = dot(&mode, &tangent.times(&mode));
        }
        let nodal = assembler.spread(&mode);
        let size = |u: &[f64; 3]| u.iter().map(|x| x * x).sum::<f64>();
        let most = (0..nodal.len()).max_by(|&a, &b| size(&nodal[a]).total_cmp(&size(&nodal[b]))).unwrap_or(0);
        Ok(Softest { stiffness, place_mm: mesh.nodes[most] })
    }
}

/// −∂r/∂drive at each node: what the moving plate does to the residual.
///
/// # Errors
/// [`SolveError::Diverged`].
fn path_direction(assembler: &Assembler, material: &Material, at: &Equilibrium) -> Result<Vec<[f64; 3]>, SolveError> {
    let mesh = assembler.mesh();
    let mut imposed = vec![[0.0; 3]; mesh.nodes.len()];
    for v in assembler.plates().held_nodes() {
        let [before, after] = [at.drive_mm, at.drive_mm + 1.0].map(|drive| assembler.imposed(v, drive));
        imposed[v] = [0, 1, 2].map(|i| before[i] - after[i]);
    }
    let configuration = Configuration { material, positions: &mesh.nodes, displacement: &at.displacement };
    let mut rate = vec![[0.0; 3]; mesh.nodes.len()];
    assembler
        .assemble_directional(&configuration, Some(&imposed), None, None, &mut rate)
        .map_err(|cause| SolveError::diverged_at(at.drive_mm, cause))?;
    Ok(rate)
}

#[cfg(test)]
mod tests {
    use super::falls_as_square_root;

    /// ν = c (d − x)^p with an end a little before d, and with a smooth change of c on the way.
    #[test]
    fn a_turning_path_is_told_from_a_branching_one() {
        let seen = |power: f64, drift: f64, x: f64| (x, (1.0 + drift * x) * (1.0 - x).powf(power));
        for (drift, end) in [(0.0, 0.999), (0.5, 0.999), (-0.3, 0.9995), (0.0, 0.995)] {
            let is_root = |power: f64| {
                falls_as_square_root(seen(power, drift, 0.94), seen(power, drift, 0.98), seen(power, drift, end))
            };
            assert!(is_root(0.5) && !is_root(1.0), "{drift}, {end}");
        }
        assert!(!falls_as_square_root((0.94, 0.06), (0.98, 0.02), (1.01, -0.01)));
    }
}
