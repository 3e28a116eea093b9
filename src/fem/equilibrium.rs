//! An equilibrium: the state of a mesh at one drive.

use std::sync::atomic::{AtomicU64, Ordering};

/// An equilibrium at one drive.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// Drive, mm.
    pub drive_mm: f64,
    /// Displacement of each node of the mesh, mm.
    pub displacement: Vec<[f64; 3]>,
    /// Pressure coefficients of each element.
    pub pressure: Vec<[f64; 4]>,
    /// Force in the direction of the drive on the moved face, N: the whole specimen, times the samples in parallel.
    pub force_n: f64,
    /// Force along +y on the moved face, N, likewise (zero where y is a mirror).
    pub normal_force_n: f64,
    /// |sum of the forces on both faces| / |force|: zero up to the solver's tolerance.
    pub reaction_imbalance: f64,
    /// Which solution it is; `None` for a state that was not solved for.
    pub(super) serial: Option<Serial>,
}

impl Equilibrium {
    /// The state without drive, displacement and pressure.
    pub(super) fn at_rest(num_nodes: usize, num_elements: usize) -> Equilibrium {
        Equilibrium {
            drive_mm: 0.0,
            displacement: vec![[0.0; 3]; num_nodes],
            pressure: vec![[0.0; 4]; num_elements],
            force_n: 0.0,
            normal_force_n: 0.0,
            reaction_imbalance: 0.0,
            serial: None,
        }
    }

    /// Adds `part` times the difference of two states of the same mesh to displacements and pressures.
    pub(super) fn add_difference(&mut self, part: f64, a: &Equilibrium, b: &Equilibrium) {
        add_difference(&mut self.displacement, part, &a.displacement, &b.displacement);
        add_difference(&mut self.pressure, part, &a.pressure, &b.pressure);
    }
}

/// x += part × (a − b).
fn add_difference<const N: usize>(x: &mut [[f64; N]], part: f64, a: &[[f64; N]], b: &[[f64; N]]) {
    for (x, (a, b)) in x.iter_mut().zip(a.iter().zip(b)) {
        for i in 0..N {
            x[i] += part * (a[i] - b[i]);
        }
    }
}

/// A number that no other solution of this process has: tells whether an assembled tangent is that of an equilibrium.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Serial(u64);

impl Serial {
    /// The next one.
    pub(super) fn next() -> Serial {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        Serial(NEXT.fetch_add(1, Ordering::Relaxed))
    }
}
