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
mod debond;
mod fibre;
mod gain;
mod gradient;
mod hole;
mod inclusion;
mod mount;
mod mullins;
mod offaxis;
mod registration;
mod relaxation;
mod slack;
mod swelling;
mod terms;
mod tilt;
mod wrap;

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
    fibre::ENTRY,
    debond::ENTRY,
    bond::ENTRY,
    inclusion::ENTRY,
];
