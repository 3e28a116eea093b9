//! In place of the triangles, in a library that is built without them.

use super::domain::Domain;
use super::error::MeshError;
use super::options::MeshOptions;
use super::section::Section;

/// No section: triangles are a feature.
///
/// # Errors
/// [`MeshError::NoTriangles`].
pub(super) fn triangle_section(_: &Domain, _: &MeshOptions) -> Result<Section, MeshError> {
    Err(MeshError::NoTriangles)
}
