//! Causes with values of their parameters, and the scenes that they make.

use super::cause::Cause;
use super::scene::Scene;
use std::sync::Arc;

/// A cause with values of its parameters.
#[derive(Clone)]
pub struct Supposed {
    /// The cause.
    pub cause: Arc<dyn Cause>,
    /// Its parameters.
    pub values: Vec<f64>,
}

impl Supposed {
    /// A cause with the values from which its fit starts.
    pub fn at_start(cause: Arc<dyn Cause>) -> Supposed {
        Supposed { values: cause.start(), cause }
    }
}

/// The scene of some causes.
pub fn scene_of(causes: &[Supposed]) -> Scene {
    let mut scene = Scene::default();
    for c in causes {
        c.cause.apply(&c.values, &mut scene);
    }
    scene
}

/// A path of scenes, from which a derivative is taken.
pub struct Path<'a> {
    /// The scene at t.
    pub to: Box<dyn Fn(f64) -> Scene + Sync + 'a>,
    /// Whether it changes the sample.
    pub changes_sample: bool,
    /// Whether it changes nothing but how the plates move.
    pub moves_only_plates: bool,
    /// The only step that changes, where it is one.
    pub only_step: Option<usize>,
}

impl<'a> Path<'a> {
    /// A path that changes the sample at every step.
    pub fn of_sample(to: impl Fn(f64) -> Scene + Sync + 'a) -> Path<'a> {
        Path { to: Box::new(to), changes_sample: true, moves_only_plates: false, only_step: None }
    }
}

/// One path per parameter of the causes, in units of its scale.
pub fn paths_of(causes: &[Supposed]) -> Vec<Path<'_>> {
    let mut paths: Vec<Path> = Vec::new();
    for (index, supposed) in causes.iter().enumerate() {
        for (n, parameter) in supposed.cause.parameters().into_iter().enumerate() {
            let only_step = parameter.only_step;
            let to = move |t: f64| {
                let mut moved = causes.to_vec();
                moved[index].values[n] += t * parameter.scale;
                scene_of(&moved)
            };
            paths.push(Path {
                to: Box::new(to),
                changes_sample: supposed.cause.changes_sample(),
                moves_only_plates: supposed.cause.moves_only_plates(),
                only_step,
            });
        }
    }
    paths
}
