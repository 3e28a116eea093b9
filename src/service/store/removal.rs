//! Deleting jobs and recordings, with whatever bytes nothing else refers to.

use super::{Row, Store, StoreError, Transaction, Value, lock_job};

/// What became of a deletion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Removed {
    /// It is gone.
    Gone,
    /// There was no such thing.
    Missing,
    /// A job that has not ended, or a recording that such a job reads.
    InUse,
}

/// Most jobs or recordings that one sweep of old ones deletes in one transaction.
const BATCH: usize = 50;

impl Store {
    /// Deletes a job that has ended: its request, results, files and checkpoints, and what is known of its evaluations.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn delete_job(&self, id: &str) -> Result<Removed, StoreError> {
        self.database.transact(&|t| {
            lock_blobs(t)?;
            remove_job(t, id)
        })
    }

    /// Deletes a recording that no unfinished job reads.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn delete_upload(&self, id: &str) -> Result<Removed, StoreError> {
        self.database.transact(&|t| {
            lock_blobs(t)?;
            remove_upload(t, id)
        })
    }

    /// Deletes jobs that ended, and recordings that were kept, more than `keep_ms` ago; how many of each.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn delete_older_than(&self, keep_ms: i64) -> Result<[usize; 2], StoreError> {
        let mut removed = [0; 2];
        let queries = [
            "SELECT id FROM jobs WHERE state NOT IN ('queued', 'running') AND finished_ms > 0 \
             AND finished_ms < {now} - $1 ORDER BY finished_ms LIMIT $2",
            "SELECT id FROM uploads u WHERE created_ms < {now} - $1 AND NOT EXISTS (SELECT 1 FROM jobs j \
             WHERE j.state IN ('queued', 'running') AND j.body LIKE '%' || u.id || '%') ORDER BY created_ms LIMIT $2",
        ];
        for (index, (query, remove)) in
            queries.into_iter().zip([remove_job as fn(&mut Transaction, &str) -> _, remove_upload]).enumerate()
        {
            loop {
                let old = self.database.read(query, &[keep_ms.into(), BATCH.into()])?;
                let gone = self.database.transact(&|t| {
                    lock_blobs(t)?;
                    let mut gone = 0;
                    for row in &old {
                        gone += usize::from(remove(t, &row.text(0))? == Removed::Gone);
                    }
                    Ok(gone)
                })?;
                removed[index] += gone;
                // What could not be removed will be there again: this sweep has done what it can.
                if old.len() < BATCH || gone == 0 {
                    break;
                }
            }
        }
        Ok(removed)
    }
}

/// Keeps others on PostgreSQL from referring to bytes while they are deleted; SQLite has one writer.
fn lock_blobs(t: &mut Transaction) -> Result<(), StoreError> {
    if let Transaction::Postgres(inner) = t {
        inner.batch_execute(
            "LOCK TABLE jobs, tasks, artefacts, results, upload_files, blobs IN SHARE ROW EXCLUSIVE MODE",
        )?;
    }
    Ok(())
}

fn remove_job(t: &mut Transaction, id: &str) -> Result<Removed, StoreError> {
    if !lock_job(t, id)? {
        return Ok(Removed::Missing);
    }
    let is_unfinished = t.query("SELECT 1 FROM jobs WHERE id = $1 AND state IN ('queued', 'running')", &[id.into()])?;
    if !is_unfinished.is_empty() {
        return Ok(Removed::InUse);
    }
    let mut blobs = t.query(
        "SELECT result_sha FROM tasks WHERE job_id = $1 UNION SELECT sha FROM artefacts WHERE job_id = $1 \
         UNION SELECT result_sha FROM jobs WHERE id = $1",
        &[id.into()],
    )?;
    // What is known of its evaluations goes with it; other jobs that were answered from it hold their own references.
    let keys = t.query("SELECT DISTINCT cache_key FROM tasks WHERE job_id = $1 AND cache_key <> ''", &[id.into()])?;
    for key in &keys {
        blobs.extend(t.query("DELETE FROM results WHERE cache_key = $1 RETURNING result_sha", &[key.text(0).into()])?);
    }
    for table in ["artefacts", "checkpoints", "tasks", "idempotency"] {
        t.execute(&format!("DELETE FROM {table} WHERE job_id = $1"), &[id.into()])?;
    }
    t.execute("DELETE FROM jobs WHERE id = $1", &[id.into()])?;
    drop_unused(t, &blobs)?;
    Ok(Removed::Gone)
}

fn remove_upload(t: &mut Transaction, id: &str) -> Result<Removed, StoreError> {
    let blobs = t.query("SELECT DISTINCT sha FROM upload_files WHERE upload_id = $1", &[id.into()])?;
    let readers = t.query(
        "SELECT 1 FROM jobs WHERE state IN ('queued', 'running') AND body LIKE '%' || $1 || '%' LIMIT 1",
        &[id.into()],
    )?;
    let is_there = !t.query("SELECT 1 FROM uploads WHERE id = $1", &[id.into()])?.is_empty();
    if !is_there {
        return Ok(Removed::Missing);
    }
    if !readers.is_empty() {
        return Ok(Removed::InUse);
    }
    t.execute("DELETE FROM upload_files WHERE upload_id = $1", &[id.into()])?;
    t.execute("DELETE FROM uploads WHERE id = $1", &[id.into()])?;
    drop_unused(t, &blobs)?;
    Ok(Removed::Gone)
}

/// Deletes those of `blobs` (SHA-256 in the first column) that nothing refers to.
fn drop_unused(t: &mut Transaction, blobs: &[Row]) -> Result<(), StoreError> {
    for row in blobs {
        let sha = row.text(0);
        if sha.is_empty() {
            continue;
        }
        t.execute(
            "DELETE FROM blobs WHERE sha = $1 AND NOT EXISTS (SELECT 1 FROM tasks WHERE result_sha = $1) \
             AND NOT EXISTS (SELECT 1 FROM jobs WHERE result_sha = $1) \
             AND NOT EXISTS (SELECT 1 FROM artefacts WHERE sha = $1) \
             AND NOT EXISTS (SELECT 1 FROM upload_files WHERE sha = $1) \
             AND NOT EXISTS (SELECT 1 FROM results WHERE result_sha = $1 OR artefacts LIKE '%' || $1 || '%')",
            &[Value::from(sha)],
        )?;
    }
    Ok(())
}
