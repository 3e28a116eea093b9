//! The recording of a hidden cause.

use super::draw::{Draw, Hidden, HiddenCause};
use crate::fem::{
    Departures, Equilibrium, Fibre, Field, ForwardModel, PlateMotion, PrepareError, SolveError, SolveOptions,
};
use crate::mesh::{MeshOptions, mesh_specimen, mesh_specimen_along};
use crate::recording::{Filter, LoadCurve, RecordedStep, Recording};
use crate::specimen::Specimen;
use crate::voxel::{Sampling, VoxelError, VoxelGrid, VoxelMask, VoxelOperator};

/// Strips thinner than this are not meshed, mm.
const LEAST_STRIP_MM: f64 = 0.3;
/// κ over the shear modulus of a rubber.
const RUBBER: f64 = 130.0;
/// Element size as a factor on the standard one.
const MESH_FACTOR: f64 = 1.6;
/// Voxels of the concealed recordings, mm.
const VOXEL_MM: [f64; 3] = [1.5, 0.4, 1.1];
/// The load cell: drift of each hold and a single reading, N.
const DRIFT_SD_N: f64 = 0.02;
const READING_SD_N: f64 = 0.03;
/// The loading: time between readings, rest, hold, and what of a hold is not scanned, s; speed, mm/s.
const INTERVAL_S: f64 = 0.5;
const REST_S: f64 = 8.0;
const HOLD_S: f64 = 56.0;
const SETTLE_S: f64 = 7.0;
const SPEED_MM_PER_S: f64 = 0.5;
/// The first cycle goes this much beyond the largest drive.
const BEYOND: f64 = 1.1;

/// Why a recording cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConcealError {
    /// No equilibrium.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// No model.
    #[error(transparent)]
    Prepare(#[from] PrepareError),
    /// No voxels.
    #[error(transparent)]
    Voxel(#[from] VoxelError),
}

/// A recording and what its cause does to it.
#[derive(Clone, Debug)]
pub struct Concealed {
    /// The recording.
    pub recording: Recording,
    /// Root mean square change of the displacement by the cause at the largest drive, mm, the material unchanged.
    pub effect_rms_mm: f64,
    /// Largest change of a force by the cause, relative to it.
    pub effect_force_relative: f64,
}

/// Makes the recording of `hidden` in `specimen`.
///
/// # Errors
/// [`ConcealError`].
pub fn conceal(specimen: &Specimen, hidden: &Hidden) -> Result<Concealed, ConcealError> {
    let made = made_specimen(specimen, hidden);
    let largest = specimen.drive_mm.iter().fold(0.0f64, |s, d| s.max(d.abs()));
    let mut drives = specimen.drive_mm.clone();
    drives.push(BEYOND * largest);
    let mut model = model_of(&made, hidden)?;
    let states = path(&mut model, hidden, &drives)?;
    let mut grid = VoxelGrid::covering(specimen, VOXEL_MM)?;
    let drawn = grid.clone();
    if hidden.cause == HiddenCause::Registration {
        grid.origin_mm[hidden.which] += hidden.strength;
    }
    let mask = VoxelMask::of_specimen(&made, grid)?;
    let operator = VoxelOperator::new(&made, model.mesh(), &mask, Sampling::default())?;
    // What the nominal model would show, for the size of the effect.
    let mut nominal = Hidden { cause: HiddenCause::None, ..hidden.clone() };
    if hidden.cause == HiddenCause::Compressibility {
        let shear_modulus = nominal.material.initial_shear_modulus_kpa();
        nominal.material.bulk_kpa = RUBBER * shear_modulus;
    }
    let mut reference = model_of(specimen, &nominal)?;
    let plain = path(&mut reference, &nominal, &drives)?;
    let plain_mask = VoxelMask::of_specimen(specimen, drawn.clone())?;
    let plain_operator = VoxelOperator::new(specimen, reference.mesh(), &plain_mask, Sampling::default())?;

    let mut noise = Draw::new(hidden.seed, 2);
    let mut steps = Vec::new();
    let (mut squares, mut count) = (0.0, 0usize);
    let flags = mask.spread(&vec![true; mask.num_voxels()], false);
    for (n, &drive_mm) in specimen.drive_mm.iter().enumerate() {
        let mut field = operator.average(&states[n].displacement)?;
        for (u, &voxel) in field.iter_mut().zip(&mask.voxels) {
            image(u, drawn.center_mm(voxel as usize), hidden, specimen, n + 1 == specimen.drive_mm.len());
        }
        if n + 1 == specimen.drive_mm.len() {
            let expected = plain_mask.spread(&plain_operator.average(&plain[n].displacement)?, [f64::NAN; 3]);
            for (u, &voxel) in field.iter().zip(&mask.voxels) {
                for c in 0..3 {
                    let change = u[c] - expected[voxel as usize][c];
                    if change.is_finite() {
                        squares += change * change;
                        count += 1;
                    }
                }
            }
        }
        let noisy: Vec<[f64; 3]> = field.iter().map(|u| u.map(|x| x + hidden.noise_sd_mm * noise.normal())).collect();
        steps.push(RecordedStep {
            drive_mm,
            force_n: None,
            force_sd_n: Some(DRIFT_SD_N),
            window_s: None,
            displacement: mask.spread(&noisy, [f64::NAN; 3]),
        });
    }
    let forces: Vec<f64> = states.iter().map(|s| s.force_n).collect();
    let (load, windows, means) = history(&drives, &forces, hidden, &mut noise);
    let mut effect_force_relative = 0.0f64;
    for (n, step) in steps.iter_mut().enumerate() {
        step.force_n = Some(means[n]);
        step.window_s = Some(windows[n]);
        effect_force_relative = effect_force_relative.max((means[n] / plain[n].force_n - 1.0).abs());
    }
    let recording = Recording {
        id: format!("hidden-{}", hidden.seed),
        specimen: specimen.clone(),
        grid: drawn,
        mask: flags,
        steps,
        noise_sd_mm: Some([hidden.noise_sd_mm; 3]),
        filter: Filter::None,
        load: Some(load),
        notes: None,
    };
    let effect_rms_mm = (squares / count.max(1) as f64).sqrt();
    Ok(Concealed { recording, effect_rms_mm, effect_force_relative })
}

/// The specimen as made, remeshed from its drawing.
fn made_specimen(specimen: &Specimen, hidden: &Hidden) -> Specimen {
    let mut made = specimen.clone();
    if hidden.cause == HiddenCause::Hole
        && let Some(hole) = made.holes.get_mut(hidden.which)
    {
        hole.diameter_mm += hidden.strength * hidden.direction[0];
        hole.center_mm[0] += hidden.strength * hidden.direction[1];
        hole.center_mm[1] += hidden.strength * hidden.direction[2];
    }
    made
}

/// Prisms; a free patch is made of free nodes, whose elements end at its edges unless these come too near to a hole.
fn model_of(made: &Specimen, hidden: &Hidden) -> Result<ForwardModel, ConcealError> {
    let options = MeshOptions { use_mirror: false, force_prisms: true, ..MeshOptions::scaled(made, MESH_FACTOR) };
    let lines = if hidden.cause == HiddenCause::Debond { patch_lines(made, hidden) } else { Vec::new() };
    let mesh =
        if lines.is_empty() { mesh_specimen(made, &options) } else { mesh_specimen_along(made, &options, &lines) };
    let mesh = mesh.map_err(PrepareError::from)?;
    let half = [0.5 * made.block.length_mm, 0.0, 0.5 * made.block.width_mm];
    let is_free = |x: [f64; 3], is_moved: bool| {
        hidden.cause == HiddenCause::Bond && hidden.which != usize::from(!is_moved)
            || hidden.cause == HiddenCause::Debond
                && is_moved == (hidden.which == 1)
                && [0, 2].into_iter().all(|a| is_inside(x[a], hidden, a, half[a]))
    };
    Ok(ForwardModel::with_released(mesh, made, &is_free)?.departed(&departures(made, hidden)))
}

/// Whether a node is in the patch along an axis: its edges hold, but for those that are the face's own.
fn is_inside(x: f64, hidden: &Hidden, axis: usize, half: f64) -> bool {
    let away = x - hidden.center_mm[axis];
    let edge = hidden.center_mm[axis] + away.signum() * 0.5 * hidden.extent_mm[axis];
    let is_own = edge.abs() > half - LEAST_STRIP_MM;
    is_own || away.abs() < 0.5 * hidden.extent_mm[axis] - 1e-6
}

/// Edges of the patch inside the section; none where an element between them and a hole or a side would be a sliver.
fn patch_lines(made: &Specimen, hidden: &Hidden) -> Vec<[[f64; 2]; 2]> {
    let half = [0.5 * made.block.length_mm, 0.5 * made.block.width_mm];
    let edges = [(0, half[0]), (2, half[1])].map(|(axis, half)| {
        // An edge nearly on the face's own is the face's own.
        [-0.5, 0.5]
            .map(|s| hidden.center_mm[axis] + s * hidden.extent_mm[axis])
            .map(|edge| if edge.abs() > half - LEAST_STRIP_MM { half * edge.signum() } else { edge })
    });
    let ([x0, x1], [z0, z1]) = (edges[0], edges[1]);
    let sides = [[[x0, z0], [x0, z1]], [[x1, z0], [x1, z1]], [[x0, z0], [x1, z0]], [[x0, z1], [x1, z1]]];
    let is_own = |l: &[[f64; 2]; 2]| (0..2).any(|c| l.iter().all(|p| p[c].abs() >= half[c] - 1e-9));
    let lines: Vec<[[f64; 2]; 2]> = sides.into_iter().filter(|l| !is_own(l)).collect();
    let is_near_hole = |l: &[[f64; 2]; 2]| {
        made.holes.iter().any(|h| {
            let nearest = [0, 1].map(|c| h.center_mm[c].clamp(l[0][c].min(l[1][c]), l[0][c].max(l[1][c])));
            let distance = (nearest[0] - h.center_mm[0]).hypot(nearest[1] - h.center_mm[1]);
            distance < 0.5 * h.diameter_mm + LEAST_STRIP_MM
        })
    };
    if lines.iter().any(is_near_hole) { Vec::new() } else { lines }
}

fn departures(made: &Specimen, hidden: &Hidden) -> Departures {
    let mut d = Departures::default();
    let b = made.block;
    let half = [0.5 * b.length_mm, 0.5 * b.thickness_mm, 0.5 * b.width_mm];
    let (strength, which) = (hidden.strength, hidden.which);
    let largest = made.drive_mm.iter().fold(1e-9f64, |s, x| s.max(x.abs()));
    let shear_modulus = hidden.material.initial_shear_modulus_kpa();
    match hidden.cause {
        HiddenCause::Gradient => {
            d.stiffness_factor = Some(Field::new(move |x| 1.0 + strength * x[which] / half[which]));
        }
        HiddenCause::Inclusion => {
            let (center, radius) = (hidden.center_mm, 0.5 * hidden.extent_mm[0]);
            d.stiffness_factor = Some(Field::new(move |x| {
                let r = (0..3).map(|a| (x[a] - center[a]).powi(2)).sum::<f64>().sqrt();
                if r < radius { strength.exp() } else { 1.0 }
            }));
        }
        HiddenCause::Swelling => d.log_growth = Some(Field::new(move |_| strength)),
        HiddenCause::Fibre => {
            d.fibre = Some(Fibre { direction: hidden.direction, modulus_kpa: strength * shear_modulus });
        }
        HiddenCause::Tilt => {
            let mut turn = PlateMotion::default();
            turn.rotation_rad_per_mm[which] = strength.to_radians() / largest;
            d.moved_plate = turn;
        }
        HiddenCause::Offaxis => {
            let mut shift = PlateMotion::default();
            shift.translation_per_mm[which] = strength / largest;
            d.moved_plate = shift;
        }
        HiddenCause::Debond => d.bond_kpa_per_mm = Some(Field::new(|_| 0.0)),
        HiddenCause::Bond => d.bond_kpa_per_mm = Some(Field::new(move |_| 1.0 / strength)),
        HiddenCause::Slack => d.moved_plate.translation_mm[0] = -strength,
        HiddenCause::Mount if which < 2 => d.moved_plate.translation_mm[1 + which] = strength,
        HiddenCause::Mount => d.moved_plate.rotation_rad[which - 2] = strength.to_radians(),
        _ => {}
    }
    d
}

/// Equilibria at the commanded drives.
fn path(model: &mut ForwardModel, hidden: &Hidden, drives: &[f64]) -> Result<Vec<Equilibrium>, ConcealError> {
    let options = SolveOptions::default();
    let never = || false;
    let mut found: Vec<Equilibrium> = Vec::new();
    for &drive in drives {
        let mut state = match model.solve(&hidden.material, drive, found.last(), &options, &never) {
            Err(_) if hidden.cause == HiddenCause::Mount => {
                model.solve_by_parts(&hidden.material, drive, &options, &never)?
            }
            found => found?,
        };
        if hidden.cause == HiddenCause::Compliance {
            // What the sample sees: the load train takes its part. A secant iteration on the real drive.
            let mut real = drive;
            for _ in 0..6 {
                let stiffness = state.force_n / real;
                let next = drive / (1.0 + hidden.strength * stiffness);
                let change = next - real;
                real = next;
                state = model.solve(&hidden.material, real, Some(&state), &options, &never)?;
                if change.abs() < 1e-6 {
                    break;
                }
            }
        }
        found.push(state);
    }
    Ok(found)
}

/// What the scan makes of a displacement.
fn image(u: &mut [f64; 3], x: [f64; 3], hidden: &Hidden, specimen: &Specimen, is_last: bool) {
    let b = specimen.block;
    let t = [x[0] / b.length_mm, x[1] / b.thickness_mm, x[2] / b.width_mm].map(|t| 2.0 * t);
    match hidden.cause {
        HiddenCause::Gain => u[hidden.which] *= 1.0 + hidden.strength,
        HiddenCause::Background => {
            let d = hidden.direction;
            u[hidden.which] += hidden.strength * (1.0 + d[0] * t[0] + d[1] * t[2] + 0.5 * d[2] * t[0] * t[2]);
        }
        HiddenCause::Wrap
            if is_last && (0..3).all(|a| (x[a] - hidden.center_mm[a]).abs() < 0.5 * hidden.extent_mm[a]) =>
        {
            u[hidden.which] += hidden.strength;
        }
        _ => {}
    }
}

/// The load curve of a first cycle beyond the largest drive and then the steps with holds; windows and mean forces of
/// the steps.
fn history(drives: &[f64], forces: &[f64], hidden: &Hidden, noise: &mut Draw) -> (LoadCurve, Vec<[f64; 2]>, Vec<f64>) {
    let num_steps = drives.len() - 1;
    let beyond = drives[num_steps];
    let mut corners = vec![[0.0, 0.0], [REST_S, 0.0]];
    let ramp = |corners: &mut Vec<[f64; 2]>, to: f64| {
        let [t, from] = corners[corners.len() - 1];
        corners.push([t + (to - from).abs() / SPEED_MM_PER_S, to]);
    };
    let hold = |corners: &mut Vec<[f64; 2]>, time: f64| {
        let [t, at] = corners[corners.len() - 1];
        corners.push([t + time, at]);
    };
    ramp(&mut corners, beyond);
    ramp(&mut corners, 0.0);
    hold(&mut corners, 3.0 * REST_S);
    let mut windows = Vec::new();
    for &drive in &drives[..num_steps] {
        ramp(&mut corners, drive);
        let arrival = corners[corners.len() - 1][0];
        hold(&mut corners, HOLD_S);
        windows.push([arrival + SETTLE_S, arrival + HOLD_S - SETTLE_S]);
    }
    ramp(&mut corners, 0.0);
    let end = corners[corners.len() - 1][0];
    let mut load = LoadCurve::default();
    let mut piece = 0;
    let (mut memory, mut last_elastic, mut furthest) = (0.0, 0.0, 0.0f64);
    let mut drift = DRIFT_SD_N * noise.normal();
    for n in 0..=(end / INTERVAL_S) as usize {
        let time = n as f64 * INTERVAL_S;
        while piece + 2 < corners.len() && corners[piece + 1][0] <= time {
            piece += 1;
            drift = DRIFT_SD_N * noise.normal();
        }
        let ([t0, d0], [t1, d1]) = (corners[piece], corners[piece + 1]);
        let drive = if t1 > t0 { d0 + (d1 - d0) * ((time - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { d1 };
        let elastic = interpolated(drives, forces, drive);
        let mut force = elastic;
        match hidden.cause {
            HiddenCause::Relaxation => {
                // The force itself relaxes (Fung's quasi-linear model), which the diagnosis does not suppose.
                let tau = hidden.center_mm[0];
                memory =
                    memory * (-INTERVAL_S / tau).exp() + (elastic - last_elastic) * (-0.5 * INTERVAL_S / tau).exp();
                force += hidden.strength * memory;
            }
            HiddenCause::Mullins => {
                // Softening in proportion to how far the drive has been, of a form of its own.
                furthest = furthest.max(drive);
                force *= 1.0 - hidden.strength * (1.0 - (-3.0 * (furthest - drive) / beyond).exp());
            }
            HiddenCause::Cell => force += hidden.strength,
            _ => {}
        }
        last_elastic = elastic;
        load.time_s.push(time);
        load.drive_mm.push(drive);
        load.force_n.push(force + drift + READING_SD_N * noise.normal());
    }
    let means = windows
        .iter()
        .map(|[start, end]| {
            let inside: Vec<f64> = load
                .time_s
                .iter()
                .zip(&load.force_n)
                .filter(|(t, _)| **t >= *start && **t <= *end)
                .map(|(_, f)| *f)
                .collect();
            inside.iter().sum::<f64>() / inside.len().max(1) as f64
        })
        .collect();
    (load, windows, means)
}

/// The odd polynomial in the drive through rest and all points (Lagrange): smooth, and exact at the steps.
fn interpolated(drives: &[f64], forces: &[f64], drive: f64) -> f64 {
    let mut sum = 0.0;
    for (i, (d, f)) in drives.iter().zip(forces).enumerate() {
        let mut weight = drive / d;
        for (j, other) in drives.iter().enumerate() {
            if i != j {
                weight *= (drive * drive - other * other) / (d * d - other * other);
            }
        }
        sum += weight * f;
    }
    sum
}
