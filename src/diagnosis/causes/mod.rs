//! The causes: what may make a recording differ from its nominal model, one file each.
//!
//! A new cause is a file here, which holds its model and its [`Entry`], and a line in [`REGISTRY`]. Everything that is
//! special about a cause is said in its file, by methods of [`super::cause::Cause`], [`super::load_effect::LoadEffect`]
//! or [`super::material_cause::MaterialCause`].

mod background;
mod bond;
mod cell;
mod compliance;
mod compressibility;
mod cut;
mod debond;
mod fibre;
mod gain;
mod gradient;
mod hole;
mod inclusion;
mod law;
mod layer;
mod mount;
mod mullins;
mod offaxis;
mod outline;
mod registration;
mod relaxation;
mod slack;
mod swelling;
mod terms;
mod tilt;
mod travel;
mod wrap;

pub(super) use travel::Travel;

use super::cause::CauseName;
use super::entry::Entry;

/// All causes. Those in the material's law and those with a place are asked in this order; for all others it only
/// decides ties.
pub(super) const REGISTRY: &[Entry] = &[
    cell::OFFSET,
    cell::FRICTION,
    mullins::ENTRY,
    relaxation::ENTRY,
    compressibility::ENTRY,
    terms::ENTRY,
    wrap::ENTRY,
    gradient::ENTRY,
    law::ENTRY,
    swelling::ENTRY,
    tilt::ENTRY,
    offaxis::ENTRY,
    mount::ENTRY,
    compliance::ENTRY,
    slack::ENTRY,
    gain::ENTRY,
    background::ENTRY,
    registration::ENTRY,
    cell::OF_STEPS,
    hole::ENTRY,
    outline::ENTRY,
    fibre::ENTRY,
    debond::ENTRY,
    bond::ENTRY,
    inclusion::ENTRY,
    cut::ENTRY,
    travel::ENTRY,
    registration::OF_SET_UP,
    swelling::OF_SET_UP,
    layer::ENTRY,
    outline::OF_SET_UP,
];

/// The causes that act where the sample is held. They say nothing of a part of it whose boundary was measured.
pub(super) const AT_BOUNDARY: &[CauseName] = &[
    tilt::ENTRY.name,
    offaxis::ENTRY.name,
    mount::ENTRY.name,
    compliance::ENTRY.name,
    slack::ENTRY.name,
    debond::ENTRY.name,
    bond::ENTRY.name,
    travel::ENTRY.name,
    layer::ENTRY.name,
    outline::ENTRY.name,
];

/// The causes that act inside the sample. They say little of a misfit that vanishes once the boundary is as measured.
/// (Swelling does not belong here: it moves the boundary, and what it does to the inside vanishes with that.)
pub(super) const INSIDE: &[CauseName] = &[
    gradient::ENTRY.name,
    law::ENTRY.name,
    hole::ENTRY.name,
    cut::ENTRY.name,
    fibre::ENTRY.name,
    inclusion::ENTRY.name,
];
