//! Margins of the geometry limits as functions of the search vector, with closed-form gradients.
//!
//! Every ligament gives one margin (length / limit − 1) and, where the study asks for voxels across it, another. The
//! distance between two holes is a convex function of the vector (whatever moves), so its linearisation never
//! overestimates it: a step that keeps the linearised margins keeps the true ones.

use super::qp::Linear;
use super::space::Subspace;
use super::study::Study;
use crate::mesh::DesignVariable;
use crate::specimen::{HoleAxis, LigamentKind, SectionEdge, Specimen, min_meshable_ligament_mm};

/// Change of a ligament per unit of a geometric quantity: of its length, and of the vector between two centres.
struct LigamentRate {
    length: f64,
    offset: [f64; 2],
}

fn rate_of(kind: LigamentKind, direction: [f64; 2], axis: HoleAxis, variable: DesignVariable) -> LigamentRate {
    let mut rate = LigamentRate { length: 0.0, offset: [0.0; 2] };
    let mut move_center = |hole: usize, component: usize| match kind {
        LigamentKind::HoleHole(i, j) => {
            let sign = f64::from(u8::from(hole == j)) - f64::from(u8::from(hole == i));
            rate.offset[component] += sign;
            rate.length += sign * direction[component];
        }
        LigamentKind::HoleEdge(i, _) if hole == i => rate.length -= direction[component],
        LigamentKind::HoleEdge(..) => {}
    };
    match variable {
        DesignVariable::HoleX(hole) => move_center(hole, 0),
        DesignVariable::HoleOther(hole) => move_center(hole, 1),
        DesignVariable::HoleDiameter(hole) => {
            let is_own = match kind {
                LigamentKind::HoleHole(i, j) => hole == i || hole == j,
                LigamentKind::HoleEdge(i, _) => hole == i,
            };
            if is_own {
                rate.length = -0.5;
            }
        }
        DesignVariable::BlockLength => {
            if matches!(kind, LigamentKind::HoleEdge(_, SectionEdge::MinusX | SectionEdge::PlusX)) {
                rate.length = 0.5;
            }
        }
        DesignVariable::BlockThickness | DesignVariable::BlockWidth => {
            let is_lateral =
                matches!(kind, LigamentKind::HoleEdge(_, SectionEdge::MinusLateral | SectionEdge::PlusLateral));
            let spans_section = (variable == DesignVariable::BlockWidth) == (axis == HoleAxis::Thickness);
            if is_lateral && spans_section {
                rate.length = 0.5;
            }
        }
    }
    rate
}

/// All margins of the geometry at a vector; each is ≥ 0 where the specimen can be made.
pub fn geometry_margins(study: &Study, subspace: &Subspace, vector: &[f64]) -> Vec<Linear> {
    let specimen = subspace.specimen(vector);
    let motions: Vec<_> = (0..subspace.variables.len()).map(|i| subspace.motion(i)).collect();
    let limits = &study.limits;
    let axis = specimen.extrusion_axis();
    let mut margins = Vec::new();
    for ligament in specimen.ligaments() {
        let diameter = match ligament.kind {
            LigamentKind::HoleEdge(i, _) => specimen.holes[i].diameter_mm,
            LigamentKind::HoleHole(i, j) => specimen.holes[i].diameter_mm.max(specimen.holes[j].diameter_mm),
        };
        let limit = limits.min_ligament_mm(ligament.kind).max(min_meshable_ligament_mm(diameter));
        let rates: Vec<LigamentRate> = motions
            .iter()
            .map(|motion| {
                let mut sum = LigamentRate { length: 0.0, offset: [0.0; 2] };
                for (variable, rate) in &motion.shape {
                    let one = rate_of(ligament.kind, ligament.direction, axis, *variable);
                    sum.length += rate * one.length;
                    sum.offset = [0, 1].map(|c| sum.offset[c] + rate * one.offset[c]);
                }
                sum
            })
            .collect();
        margins.push(Linear {
            value: ligament.length_mm / limit - 1.0,
            gradient: rates.iter().map(|r| r.length / limit).collect(),
        });
        if let Some(limit) = limits.min_voxels_across_ligament.filter(|l| *l > 0.0) {
            let lateral = if axis == HoleAxis::Thickness { study.scan.voxel_mm[2] } else { study.scan.voxel_mm[1] };
            let voxel = [study.scan.voxel_mm[0], lateral];
            let d = ligament.direction;
            let k = if d[0].abs() / voxel[0] >= d[1].abs() / voxel[1] { 0 } else { 1 };
            let distance = match ligament.kind {
                LigamentKind::HoleHole(i, j) => {
                    let (a, b) = (specimen.holes[i].center_mm, specimen.holes[j].center_mm);
                    (b[0] - a[0]).hypot(b[1] - a[1]).max(1e-9)
                }
                // The direction to a straight side does not turn.
                LigamentKind::HoleEdge(..) => f64::INFINITY,
            };
            let scale = 1.0 / (voxel[k] * limit);
            let gradient = rates
                .iter()
                .map(|r| {
                    let along = d[0] * r.offset[0] + d[1] * r.offset[1];
                    let turn = (r.offset[k] - d[k] * along) / distance;
                    scale * (r.length * d[k].abs() + ligament.length_mm * turn * d[k].signum())
                })
                .collect();
            margins.push(Linear { value: scale * ligament.length_mm * d[k].abs() - 1.0, gradient });
        }
    }
    margins.push(drive_margin(subspace, &specimen, &motions));
    margins
}

/// The drive must stay within what is supported for the block (shear strain, nominal stretch).
fn drive_margin(subspace: &Subspace, specimen: &Specimen, motions: &[super::evaluator::Motion]) -> Linear {
    let limit = specimen.max_supported_drive_mm();
    let drive = specimen.drive_mm.last().copied().unwrap_or(0.0);
    let extent = match specimen.test {
        crate::specimen::TestKind::DoubleLapShear => (DesignVariable::BlockThickness, specimen.block.thickness_mm),
        crate::specimen::TestKind::Uniaxial => (DesignVariable::BlockLength, specimen.block.length_mm),
    };
    let is_dumbbell = subspace.is_dumbbell();
    let gradient = motions
        .iter()
        .map(|m| {
            let growth: f64 = m.shape.iter().filter(|(v, _)| *v == extent.0 && !is_dumbbell).map(|(_, r)| r).sum();
            drive / limit * growth / extent.1 - m.drive_mm / limit
        })
        .collect();
    Linear { value: 1.0 - drive / limit, gradient }
}

/// Whether a specimen can be made, scanned and meshed as far as geometry and drive tell.
pub fn is_makeable(study: &Study, specimen: &Specimen) -> bool {
    let drive = specimen.drive_mm.iter().copied().fold(0.0, f64::max);
    specimen.validate().is_ok()
        && study.limits.check_geometry(specimen, study.scan.voxel_mm).iter().all(|m| m.is_satisfied)
        && study.limits.max_drive_mm.is_none_or(|limit| drive <= limit * (1.0 + 1e-9))
}

/// Moves a vector until all margins are kept: repeated projection on the most violated linearised margin. `None` where
/// that does not succeed (the structure may not fit at all).
pub fn repaired(study: &Study, subspace: &Subspace, vector: &[f64]) -> Option<Vec<f64>> {
    let mut x: Vec<f64> = vector.iter().map(|t| t.clamp(0.0, 1.0)).collect();
    for _ in 0..60 {
        x = subspace.snapped(&x);
        let margins = geometry_margins(study, subspace, &x);
        let worst = margins.iter().min_by(|a, b| a.value.total_cmp(&b.value))?;
        if worst.value >= 0.0 {
            return is_makeable(study, &subspace.specimen(&x)).then_some(x);
        }
        let free: Vec<bool> = (0..x.len()).map(|i| subspace.is_continuous(i)).collect();
        let squared: f64 = worst.gradient.iter().zip(&free).filter(|(_, f)| **f).map(|(g, _)| g * g).sum();
        if !(squared > 1e-20) {
            return None;
        }
        // A little further than the linearisation asks, so that the iteration ends.
        let length = (0.02 - worst.value) / squared;
        for ((x, g), free) in x.iter_mut().zip(&worst.gradient).zip(&free) {
            if *free {
                *x = (*x + length * g).clamp(0.0, 1.0);
            }
        }
    }
    None
}
