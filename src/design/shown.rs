//! What the samples of a design do, as solved and as they are a small step further along a move of the design.

use crate::fem::{ForwardModel, ParameterSensitivity, PathSensitivity};
use crate::material::Material;
use crate::sensitivity::{ForceReading, MaterialState};

/// An earlier material fitted to a sample's scan.
#[derive(Clone)]
pub(super) struct ImitatingMaterial {
    /// The sample whose scan it is.
    pub of: usize,
    pub material: Material,
    pub state: MaterialState,
}

/// Forces read on the way to the scan with one material, and their derivatives.
pub(super) struct OnTheWay {
    pub readings: Vec<ForceReading>,
    /// Per move, then per reading: rates.
    pub rates: Vec<Vec<ForceReading>>,
}

/// All that one kind of sample does at one drive.
pub(super) struct Solved {
    /// Per material sample.
    pub states: Vec<MaterialState>,
    /// Per material sample: the forces before.
    pub on_the_way: Vec<OnTheWay>,
    /// Earlier materials fitted to them, where the study asks for it.
    pub imitators: Vec<ImitatingMaterial>,
    /// Per state, then per fitted material: derivatives along each move.
    pub paths: Vec<Vec<PathSensitivity>>,
}

/// One kind of sample of a design, meshed.
pub(super) struct Block {
    pub model: ForwardModel,
    /// Whether it is held by plates, across which there is a force.
    pub has_plates: bool,
    /// How many of the kind are scanned.
    pub num_scanned: u32,
}

/// One kind of sample as it is judged, or as it is a step further on: its nodes and what it does.
pub(super) struct Shown<'s> {
    pub block: &'s Block,
    pub positions: Vec<[f64; 3]>,
    pub states: Vec<MaterialState>,
    pub readings: Vec<Vec<ForceReading>>,
    pub imitators: Vec<ImitatingMaterial>,
}

impl<'s> Shown<'s> {
    pub fn as_solved(block: &'s Block, solved: &Solved) -> Shown<'s> {
        Shown {
            block,
            positions: block.model.mesh().nodes.clone(),
            states: solved.states.clone(),
            readings: solved.on_the_way.iter().map(|w| w.readings.clone()).collect(),
            imitators: solved.imitators.clone(),
        }
    }

    /// A `step` further along the move with this index, whose `velocity` the nodes have.
    pub fn moved(
        block: &'s Block,
        solved: &Solved,
        index: usize,
        (velocity, step): (Option<&[[f64; 3]]>, f64),
    ) -> Shown<'s> {
        let shift = |x: &[[f64; 3]], v: &[[f64; 3]]| -> Vec<[f64; 3]> {
            x.iter().zip(v).map(|(a, b)| [0, 1, 2].map(|i| a[i] + step * b[i])).collect()
        };
        let follow = |state: &MaterialState, path: &PathSensitivity| MaterialState {
            displacement: shift(&state.displacement, &path.displacement),
            force_n: state.force_n + step * path.force_n,
            normal_force_n: state.normal_force_n + step * path.normal_force_n,
            sensitivities: state
                .sensitivities
                .iter()
                .zip(&path.parameters)
                .map(|(s, d)| ParameterSensitivity {
                    parameter: s.parameter,
                    displacement: shift(&s.displacement, &d.displacement),
                    force_n: s.force_n + step * d.force_n,
                })
                .collect(),
        };
        let (of_states, of_imitators) = solved.paths.split_at(solved.states.len());
        let followed = |way: &OnTheWay| -> Vec<ForceReading> {
            way.readings.iter().zip(&way.rates[index]).map(|(r, rate)| followed_reading(r, rate, step)).collect()
        };
        let nodes = &block.model.mesh().nodes;
        Shown {
            block,
            positions: velocity.map_or_else(|| nodes.clone(), |v| shift(nodes, v)),
            states: solved.states.iter().zip(of_states).map(|(state, paths)| follow(state, &paths[index])).collect(),
            readings: solved.on_the_way.iter().map(followed).collect(),
            imitators: solved
                .imitators
                .iter()
                .zip(of_imitators)
                .map(|(i, paths)| ImitatingMaterial { state: follow(&i.state, &paths[index]), ..i.clone() })
                .collect(),
        }
    }
}

/// The forces of all samples together: those read on the way, then the scan's own.
pub(super) fn sum_of_readings(shown: &[Shown], index: usize) -> Vec<ForceReading> {
    let mut sums: Vec<ForceReading> = Vec::new();
    for block in shown {
        let state = &block.states[index];
        let own = ForceReading {
            force_n: state.force_n,
            sensitivities: state.sensitivities.iter().map(|s| s.force_n).collect(),
        };
        for (place, reading) in block.readings[index].iter().chain([&own]).enumerate() {
            match sums.get_mut(place) {
                Some(sum) => *sum = followed_reading(sum, reading, 1.0),
                None => sums.push(reading.clone()),
            }
        }
    }
    sums
}

/// A force and its sensitivities a `step` further on.
fn followed_reading(reading: &ForceReading, rate: &ForceReading, step: f64) -> ForceReading {
    let sensitivities = reading.sensitivities.iter().zip(&rate.sensitivities).map(|(s, d)| s + step * d).collect();
    ForceReading { force_n: reading.force_n + step * rate.force_n, sensitivities }
}
