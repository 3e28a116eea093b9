//! Uploaded recordings: their files as blobs. A name from outside is a column's value, never a path.

use super::blobs::put_blob;
use super::{Store, StoreError};
use std::fs::File;
use std::path::PathBuf;

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
    /// Its files.
    pub files: Vec<UploadFile>,
}

/// A file of an upload to keep: it is read when it is stored, one at a time.
#[derive(Clone, Debug)]
pub struct UploadFile {
    /// Name.
    pub name: String,
    /// Where it lies until then.
    pub path: PathBuf,
    /// Length.
    pub num_bytes: u64,
    /// SHA-256 of its content, hexadecimal.
    pub sha: String,
}

/// An upload as stored.
#[derive(Clone, Debug)]
pub struct UploadRow {
    /// Identifier.
    pub id: String,
    /// Name of the token that uploaded it, or whose job made it.
    pub owner: String,
    /// For lists.
    pub title: String,
    /// Summary, JSON.
    pub manifest: String,
    /// Length of all files.
    pub num_bytes: i64,
    /// Milliseconds since 1970.
    pub created_ms: i64,
}

/// A file of an upload as stored.
#[derive(Clone, Debug)]
pub struct KeptFile {
    /// Name.
    pub name: String,
    /// SHA-256 of its content, hexadecimal.
    pub sha: String,
    /// Length.
    pub num_bytes: i64,
}

impl Store {
    /// Keeps an upload; an equal one is kept once.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn put_upload(&self, upload: &NewUpload) -> Result<(), StoreError> {
        self.database.transact(&|t| {
            let total: u64 = upload.files.iter().map(|f| f.num_bytes).sum();
            let made = t.execute(
                "INSERT INTO uploads (id, owner, title, manifest, num_bytes, created_ms) \
                 VALUES ($1, $2, $3, $4, $5, {now}) ON CONFLICT DO NOTHING",
                &[
                    (&upload.id).into(),
                    (&upload.owner).into(),
                    (&upload.title).into(),
                    (&upload.manifest).into(),
                    (total as usize).into(),
                ],
            )?;
            if made == 0 {
                return Ok(());
            }
            for UploadFile { name, path, num_bytes, sha } in &upload.files {
                let failed = |source| StoreError::Folder { path: path.clone(), source };
                put_blob(t, sha, *num_bytes, &mut File::open(path).map_err(failed)?)?;
                t.execute(
                    "INSERT INTO upload_files (upload_id, name, sha, num_bytes) VALUES ($1, $2, $3, $4)",
                    &[(&upload.id).into(), name.into(), sha.into(), (*num_bytes as usize).into()],
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
            "SELECT id, title, manifest, num_bytes, created_ms, owner FROM uploads ORDER BY created_ms DESC, id LIMIT $1",
            &[limit.into()],
        )?;
        Ok(rows.iter().map(upload_of).collect())
    }

    /// One upload.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn upload(&self, id: &str) -> Result<Option<UploadRow>, StoreError> {
        let rows = self.database.read(
            "SELECT id, title, manifest, num_bytes, created_ms, owner FROM uploads WHERE id = $1",
            &[id.into()],
        )?;
        Ok(rows.first().map(upload_of))
    }

    /// An upload's files, by name.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn upload_files(&self, id: &str) -> Result<Vec<KeptFile>, StoreError> {
        let rows = self
            .database
            .read("SELECT name, sha, num_bytes FROM upload_files WHERE upload_id = $1 ORDER BY name", &[id.into()])?;
        Ok(rows.iter().map(|r| KeptFile { name: r.text(0), sha: r.text(1), num_bytes: r.int(2) }).collect())
    }

    /// An owner's largest uploads; anybody's where `owner` is empty.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn largest_uploads(&self, owner: &str, limit: usize) -> Result<Vec<UploadRow>, StoreError> {
        let rows = self.database.read(
            "SELECT id, title, '', num_bytes, created_ms, owner FROM uploads WHERE ($1 = '' OR owner = $1) \
             ORDER BY num_bytes DESC, created_ms LIMIT $2",
            &[owner.into(), limit.into()],
        )?;
        Ok(rows.iter().map(upload_of).collect())
    }

    /// Length of all uploads of an owner, bytes; of everybody's where `owner` is empty.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn uploaded_bytes(&self, owner: &str) -> Result<i64, StoreError> {
        // SUM of BIGINT is NUMERIC on PostgreSQL.
        let rows = self.database.read(
            "SELECT CAST(COALESCE(SUM(num_bytes), 0) AS BIGINT) FROM uploads WHERE $1 = '' OR owner = $1",
            &[owner.into()],
        )?;
        Ok(rows.first().map_or(0, |r| r.int(0)))
    }
}

fn upload_of(r: &super::Row) -> UploadRow {
    UploadRow {
        owner: r.text(5),
        id: r.text(0),
        title: r.text(1),
        manifest: r.text(2),
        num_bytes: r.int(3),
        created_ms: r.int(4),
    }
}
