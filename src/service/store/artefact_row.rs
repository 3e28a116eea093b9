//! A file of a job, as its row says.

use super::Row;

/// An artefact as stored.
#[derive(Clone, Debug)]
pub struct ArtefactRow {
    /// Name in the job.
    pub name: String,
    /// Media type.
    pub media_type: String,
    /// SHA-256 of the bytes.
    pub sha: String,
    /// Length.
    pub num_bytes: i64,
}

impl ArtefactRow {
    /// From name, media type, SHA-256 and length.
    pub(super) fn of(row: &Row) -> ArtefactRow {
        ArtefactRow { name: row.text(0), media_type: row.text(1), sha: row.text(2), num_bytes: row.int(3) }
    }
}
