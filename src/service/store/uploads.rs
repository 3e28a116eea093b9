//! Uploaded recordings: their files as blobs. A name from outside is a column's value, never a path.

use super::{Store, StoreError, put_blob};

/// An upload to keep.
#[derive(Clone, Debug)]
pub struct NewUpload {
    /// Identifier: SHA-256 over names and contents, so equal uploads are one.
    pub id: String,
    /// Name of the token.
    pub owner: String,
    /// For lists.
    pub title: String,
    /// Summary, JSON.
    pub manifest: String,
    /// Name and bytes.
    pub files: Vec<(String, Vec<u8>)>,
}

/// An upload as stored.
#[derive(Clone, Debug)]
pub struct UploadRow {
    /// Identifier.
    pub id: String,
    /// For lists.
    pub title: String,
    /// Summary, JSON.
    pub manifest: String,
    /// Length of all files.
    pub num_bytes: i64,
    /// Milliseconds since 1970.
    pub created_ms: i64,
}

impl Store {
    /// Keeps an upload; an equal one is kept once.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn put_upload(&self, upload: &NewUpload) -> Result<(), StoreError> {
        self.database.transact(&|t| {
            let total: usize = upload.files.iter().map(|f| f.1.len()).sum();
            let made = t.execute(
                "INSERT INTO uploads (id, owner, title, manifest, num_bytes, created_ms) \
                 VALUES ($1, $2, $3, $4, $5, {now}) ON CONFLICT DO NOTHING",
                &[
                    (&upload.id).into(),
                    (&upload.owner).into(),
                    (&upload.title).into(),
                    (&upload.manifest).into(),
                    total.into(),
                ],
            )?;
            if made == 0 {
                return Ok(());
            }
            for (name, bytes) in &upload.files {
                let sha = put_blob(t, bytes)?;
                t.execute(
                    "INSERT INTO upload_files (upload_id, name, sha, num_bytes) VALUES ($1, $2, $3, $4)",
                    &[(&upload.id).into(), name.into(), sha.into(), bytes.len().into()],
                )?;
            }
            Ok(())
        })
    }

    /// Uploads, newest first.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn uploads(&self, limit: usize) -> Result<Vec<UploadRow>, StoreError> {
        let rows = self.database.read(
            "SELECT id, title, manifest, num_bytes, created_ms FROM uploads ORDER BY created_ms DESC, id LIMIT $1",
            &[limit.into()],
        )?;
        Ok(rows.iter().map(upload_of).collect())
    }

    /// One upload.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn upload(&self, id: &str) -> Result<Option<UploadRow>, StoreError> {
        let rows = self
            .database
            .read("SELECT id, title, manifest, num_bytes, created_ms FROM uploads WHERE id = $1", &[id.into()])?;
        Ok(rows.first().map(upload_of))
    }

    /// An upload's files: name and bytes.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn upload_files(&self, id: &str) -> Result<Vec<(String, Vec<u8>)>, StoreError> {
        let rows = self.database.read(
            "SELECT f.name, b.bytes FROM upload_files f JOIN blobs b ON b.sha = f.sha WHERE f.upload_id = $1 ORDER BY f.name",
            &[id.into()],
        )?;
        Ok(rows.iter().map(|r| (r.text(0), r.blob(1))).collect())
    }

    /// Length of all uploads, bytes.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn uploaded_bytes(&self) -> Result<i64, StoreError> {
        // SUM of BIGINT is NUMERIC on PostgreSQL.
        let rows = self.database.read("SELECT CAST(COALESCE(SUM(num_bytes), 0) AS BIGINT) FROM uploads", &[])?;
        Ok(rows.first().map_or(0, |r| r.int(0)))
    }
}

fn upload_of(r: &super::Row) -> UploadRow {
    UploadRow { id: r.text(0), title: r.text(1), manifest: r.text(2), num_bytes: r.int(3), created_ms: r.int(4) }
}
