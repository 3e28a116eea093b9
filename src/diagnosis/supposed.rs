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

/// The scene of some causes.
pub fn scene_of(causes: &[Supposed]) -> Scene {
    let mut scene = Scene::default();
    for c in causes {
        c.cause.apply(&c.values, &mut scene);
    }
    scene
}

/// A path of scenes, and whether it changes the sample.
pub type Path<'a> = (Box<dyn Fn(f64) -> Scene + 'a>, bool);

/// One path per parameter of the causes, in units of its scale.
pub fn paths_of(causes: &[Supposed]) -> Vec<Path<'_>> {
    let mut paths: Vec<Path> = Vec::new();
    for (index, supposed) in causes.iter().enumerate() {
        for (n, parameter) in supposed.cause.parameters().into_iter().enumerate() {
            let path = move |t: f64| {
                let mut moved = causes.to_vec();
                moved[index].values[n] += t * parameter.scale;
                scene_of(&moved)
            };
            paths.push((Box::new(path), supposed.cause.changes_sample()));
        }
    }
    paths
}
