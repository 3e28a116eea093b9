//! Rates, at every node and element of a mesh, along which a residual is differentiated.

use super::element_data::{FibreDifference, MAX_GROUPS, MAX_NODES, Variation};
use super::law_correction::LawCorrection;
use crate::material::{Lanes, Parameter};

/// Rates per unit of t. What is absent stays.
#[derive(Clone, Copy, Default)]
pub(super) struct Rates<'a> {
    /// Of the reference position of each node, mm.
    pub(super) velocity: Option<&'a [[f64; 3]]>,
    /// Of the displacement of each node, following it, mm.
    pub(super) displacement: Option<&'a [[f64; 3]]>,
    /// The parameter of the material that moves by 1.
    pub(super) parameter: Option<Parameter>,
    /// Of the factor on the stiffness, at the quadrature points of every element.
    pub(super) stiffness_factor: Option<&'a [[Lanes; MAX_GROUPS]]>,
    /// Of ln of the volume ratio free of pressure, likewise.
    pub(super) log_growth: Option<&'a [[Lanes; MAX_GROUPS]]>,
    /// The fibres at the ends of a central difference.
    pub(super) fibre: Option<FibreDifference>,
    /// Of the correction of the material's law.
    pub(super) law: Option<LawCorrection>,
}

impl<'a> Rates<'a> {
    /// In element `e`, whose nodes are `nodes`; `None` where nothing of the element changes.
    pub(super) fn of_element(&self, e: usize, nodes: &[u32]) -> Option<Variation<'a>> {
        let variation = Variation {
            velocities: self.velocity.and_then(|nodal| local(nodal, nodes)),
            displacements: self.displacement.and_then(|nodal| local(nodal, nodes)),
            parameter: self.parameter,
            stiffness_factor: self.stiffness_factor.map(|all| &all[e]).filter(|own| is_any(own)),
            log_growth: self.log_growth.map(|all| &all[e]).filter(|own| is_any(own)),
            fibre: self.fibre,
            law: self.law,
        };
        let changes = variation.velocities.is_some()
            || variation.displacements.is_some()
            || variation.parameter.is_some()
            || variation.stiffness_factor.is_some()
            || variation.log_growth.is_some()
            || variation.fibre.is_some()
            || variation.law.is_some();
        changes.then_some(variation)
    }
}

/// The entries of an element's nodes; `None` where all are zero.
fn local(nodal: &[[f64; 3]], nodes: &[u32]) -> Option<[[f64; 3]; MAX_NODES]> {
    let mut found = [[0.0; 3]; MAX_NODES];
    for (own, &v) in found.iter_mut().zip(nodes) {
        *own = nodal[v as usize];
    }
    found.iter().flatten().any(|x| x.abs() > 0.0).then_some(found)
}

fn is_any(values: &[Lanes; MAX_GROUPS]) -> bool {
    values.iter().flat_map(|lanes| lanes.0).any(|x| x.abs() > 0.0)
}
