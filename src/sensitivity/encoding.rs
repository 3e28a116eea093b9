//! What phase encoding costs a scan where the displacement changes from place to place.
//!
//! A scanner sees the displacement u of a direction as a phase u/s (s: displacement per phase). The noise of the phase
//! is that of the image over its magnitude, so that a strong encoding (small s) has little noise in mm. Its price: over
//! a voxel of edges h the phase changes by Δⱼ = ∂ⱼu hⱼ/s, the signal that the voxel averages falls to
//! Π sinc(Δⱼ/2), and where neighbours differ by more than half a turn they do not tell how many turns lie between them.
//! What unwrapping then keeps is worked out as the reconstruction of a real scan does it.

use super::scan_settings::ScanSettings;
use crate::kinematics::{IDENTITY, Tensor};
use crate::voxel::VoxelMask;
use std::f64::consts::PI;

/// A voxel whose phase has a larger standard deviation is left out, rad: two neighbours then differ by noise alone with
/// a standard deviation of one radian.
pub(crate) const MAX_PHASE_SD: f64 = 0.7;
/// Neighbours are joined where their difference is at least this many standard deviations away from half a turn.
pub(crate) const MIN_MARGIN: f64 = 2.0;

/// The encoding of a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Encoding {
    voxel_mm: [f64; 3],
    /// By direction.
    mm_per_radian: [f64; 3],
    /// Standard deviation of the phase of a full voxel that is displaced evenly, rad, by direction.
    phase_sd: [f64; 3],
}

impl Encoding {
    /// That of a scan; `None` where the scan does not say how it encodes.
    pub(crate) fn of(scan: &ScanSettings) -> Option<Encoding> {
        let mm_per_radian = scan.mm_per_radian?;
        let phase_sd = [0, 1, 2].map(|a| scan.noise_sd_mm[a] / mm_per_radian[a]);
        Some(Encoding { voxel_mm: scan.voxel_mm, mm_per_radian, phase_sd })
    }

    /// The part of its signal that each voxel of a mask keeps by direction, from the voxels' mean displacements (mm)
    /// and deformation gradients: its noise is as many times larger as this is smaller than 1. Zeros where one of its
    /// three phases cannot be unwrapped or drowns in noise, so that the voxel has no displacement.
    pub(crate) fn signal_left(
        &self,
        mask: &VoxelMask,
        displacement: &[[f64; 3]],
        deformation_gradients: &[Tensor],
    ) -> Vec<[f64; 3]> {
        let mut signal: Vec<[f64; 3]> = deformation_gradients.iter().map(|f| self.within_voxel(f)).collect();
        let neighbours = neighbours_in(mask);
        let is_kept = [0, 1, 2].map(|direction| {
            let phase: Vec<f64> = displacement.iter().map(|u| u[direction] / self.mm_per_radian[direction]).collect();
            let sd: Vec<f64> = signal.iter().map(|left| self.phase_sd[direction] / left[direction]).collect();
            unwrapped(&neighbours, &phase, &sd)
        });
        for (voxel, left) in signal.iter_mut().enumerate() {
            if !is_kept.iter().all(|kept| kept[voxel]) {
                *left = [0.0; 3];
            }
        }
        signal
    }

    /// The part of its signal that a voxel with this mean deformation gradient keeps by direction.
    fn within_voxel(&self, deformation_gradient: &Tensor) -> [f64; 3] {
        [0, 1, 2].map(|direction| {
            let of_axis = |axis: usize| {
                let gradient = deformation_gradient[direction][axis] - IDENTITY[direction][axis];
                sinc(0.5 * gradient * self.voxel_mm[axis] / self.mm_per_radian[direction]).abs()
            };
            of_axis(0) * of_axis(1) * of_axis(2)
        })
    }
}

/// Pairs of voxels of a mask that share a face, by their places in it.
fn neighbours_in(mask: &VoxelMask) -> Vec<[usize; 2]> {
    let grid = &mask.grid;
    let mut place = vec![usize::MAX; grid.num_voxels()];
    mask.voxels.iter().enumerate().for_each(|(n, voxel)| place[*voxel as usize] = n);
    let mut pairs = Vec::with_capacity(3 * mask.voxels.len());
    for (n, voxel) in mask.voxels.iter().enumerate() {
        let indices = grid.indices(*voxel as usize);
        for axis in 0..3 {
            if indices[axis] + 1 < grid.shape[axis] {
                let next = place[*voxel as usize + grid.stride(axis)];
                if next != usize::MAX {
                    pairs.push([n, next]);
                }
            }
        }
    }
    pairs
}

/// Which voxels unwrapping keeps of phases with these standard deviations: none of too much noise; of neighbours more
/// than half a turn apart not both, and first those go that are so far from most; of the rest the largest region that
/// holds together by differences which noise cannot have turned.
fn unwrapped(neighbours: &[[usize; 2]], phase: &[f64], sd: &[f64]) -> Vec<bool> {
    let mut is_kept: Vec<bool> = sd.iter().map(|sd| *sd <= MAX_PHASE_SD).collect();
    let apart = |pair: &[usize; 2]| (phase[pair[1]] - phase[pair[0]]).abs();
    let mut far_from: Vec<Vec<usize>> = vec![Vec::new(); phase.len()];
    for pair in neighbours.iter().filter(|pair| apart(pair) > PI) {
        far_from[pair[0]].push(pair[1]);
        far_from[pair[1]].push(pair[0]);
    }
    let mut steep: Vec<usize> = (0..phase.len()).filter(|v| !far_from[*v].is_empty()).collect();
    steep.sort_by_key(|v| std::cmp::Reverse(far_from[*v].len()));
    for voxel in steep {
        is_kept[voxel] &= !far_from[voxel].iter().any(|other| is_kept[*other]);
    }
    let mut regions = Regions::new(phase.len());
    for pair @ &[a, b] in neighbours {
        // Noise of two neighbours is independent.
        if is_kept[a] && is_kept[b] && apart(pair) + MIN_MARGIN * sd[a].hypot(sd[b]) <= PI {
            regions.join(a, b);
        }
    }
    let root: Vec<usize> = (0..phase.len()).map(|v| regions.root(v)).collect();
    let mut size = vec![0usize; phase.len()];
    (0..phase.len()).filter(|v| is_kept[*v]).for_each(|v| size[root[v]] += 1);
    let largest = (0..phase.len()).rev().max_by_key(|r| size[*r]);
    (0..phase.len()).map(|v| is_kept[v] && Some(root[v]) == largest).collect()
}

/// Disjoint sets of voxels, as a forest whose paths are halved when they are walked.
struct Regions {
    parent: Vec<usize>,
}

impl Regions {
    fn new(num: usize) -> Regions {
        Regions { parent: (0..num).collect() }
    }

    fn root(&mut self, mut voxel: usize) -> usize {
        while self.parent[voxel] != voxel {
            self.parent[voxel] = self.parent[self.parent[voxel]];
            voxel = self.parent[voxel];
        }
        voxel
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b);
    }
}

/// sin(x)/x.
fn sinc(x: f64) -> f64 {
    if x.abs() < 1e-4 { 1.0 - x * x / 6.0 } else { x.sin() / x }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn encoding(mm_per_radian: f64, noise_sd_mm: f64) -> Encoding {
        let scan = ScanSettings {
            voxel_mm: [1.0, 0.25, 0.5],
            noise_sd_mm: [noise_sd_mm; 3],
            mm_per_radian: Some([mm_per_radian; 3]),
            ..ScanSettings::default()
        };
        Encoding::of(&scan).expect("it encodes")
    }

    /// Shear of 0.8 along y, of −0.1 along z: the phase of x changes by 0.8 × 0.25 / 0.1 and 0.1 × 0.5 / 0.1, that of
    /// the others not at all. By hand.
    #[test]
    fn gradients_take_signal() {
        let sheared = [[1.0, 0.8, -0.1], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let left = encoding(0.1, 1e-3).within_voxel(&sheared);
        assert!((left[0] - 1f64.sin() * 0.25f64.sin() / 0.25).abs() < 1e-12, "{left:?}");
        assert_eq!(left[1..], [1.0, 1.0]);
        // Small arguments: the series meets the quotient.
        assert!((sinc(1e-4) - (1e-4f64).sin() / 1e-4).abs() < 1e-15 && (sinc(9.9e-5) - 1.0).abs() < 2e-9);
    }

    /// A row of voxels, each as many radians from the one before.
    fn kept(steps: &[f64], sd: f64) -> Vec<bool> {
        let mut phase = vec![0.0];
        steps.iter().for_each(|step| phase.push(phase[phase.len() - 1] + step));
        let neighbours: Vec<[usize; 2]> = (0..steps.len()).map(|n| [n, n + 1]).collect();
        unwrapped(&neighbours, &phase, &vec![sd; phase.len()])
    }

    /// Half a turn from voxel to voxel is not told from half a turn back, and the less the more noise there is; noise
    /// alone drowns a phase; the largest region stays.
    #[test]
    fn phases_are_lost() {
        let lost = |list: &[usize], num: usize| (0..num).map(|n| !list.contains(&n)).collect::<Vec<_>>();
        assert_eq!(kept(&[3.1, -3.1, 3.1], 1e-3), lost(&[], 4));
        assert_eq!(kept(&[3.1, -3.1, 3.1], 0.71), lost(&[0, 1, 2, 3], 4));
        // 2.6 and two standard deviations of a difference, 2 √2 × 0.2, are more than half a turn; 2.5 are not.
        assert_eq!(kept(&[0.1, 2.6, 0.1, 0.1], 0.2), lost(&[0, 1], 5));
        assert_eq!(kept(&[0.1, 2.5, 0.1, 0.1], 0.2), lost(&[], 5));
        // The voxel between two steep differences goes, and with it one side.
        assert_eq!(kept(&[0.1, 0.1, 3.2, 3.2, 0.1], 1e-3), lost(&[3, 4, 5], 6));
    }

    /// In a plane a steep difference is bridged by the others around it.
    #[test]
    fn gentle_ways_lead_around_steep_ones() {
        // 2.8 rad from 0 to 1 directly, in three steps around.
        let neighbours = [[0, 1], [0, 2], [1, 3], [2, 3]];
        assert_eq!(unwrapped(&neighbours, &[0.0, 2.8, 0.9, 1.9], &[0.2; 4]), [true; 4]);
        assert_eq!(unwrapped(&neighbours[..3], &[0.0, 2.8, 0.9, 1.9], &[0.2; 4]), [true, false, true, false]);
    }

    /// Neighbours share a face: in a block of nx × ny × nz there are 3 nx ny nz − nx ny − ny nz − nz nx pairs.
    #[test]
    fn neighbours_share_faces() {
        let specimen = super::super::continuum::tests::block("neighbours");
        let grid = crate::voxel::VoxelGrid::covering(&specimen, [2.0, 1.0, 3.0]).expect("a grid");
        let mask = VoxelMask::of_specimen(&specimen, grid).expect("a mask");
        let pairs = neighbours_in(&mask);
        let [x, y, z] = mask.grid.shape;
        assert_eq!(mask.num_voxels(), x * y * z);
        assert_eq!(pairs.len(), 3 * x * y * z - x * y - y * z - z * x);
        let centre = |place: usize| mask.grid.center_mm(mask.voxels[place] as usize);
        for [a, b] in pairs {
            let (a, b) = (centre(a), centre(b));
            let num_apart = (0..3).filter(|&i| (b[i] - a[i] - mask.grid.voxel_mm[i]).abs() < 1e-9).count();
            assert_eq!((num_apart, (0..3).filter(|&i| (b[i] - a[i]).abs() < 1e-9).count()), (1, 2));
        }
    }
}
