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
            "SELECT id FROM uploads u WHERE created_ms < {now} - $1 AND NOT EXISTS (SELECT 1 FROM job_inputs i \
             JOIN jobs j ON j.id = i.job_id WHERE i.upload_id = u.id AND j.state IN ('queued', 'running')) \
             ORDER BY created_ms LIMIT $2",
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
            "LOCK TABLE jobs, tasks, artefacts, results, result_files, upload_files, blobs IN SHARE ROW EXCLUSIVE MODE",
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
        blobs.extend(t.query("DELETE FROM result_files WHERE cache_key = $1 RETURNING sha", &[key.text(0).into()])?);
        blobs.extend(t.query("DELETE FROM results WHERE cache_key = $1 RETURNING result_sha", &[key.text(0).into()])?);
    }
    for table in ["artefacts", "checkpoints", "job_inputs", "tasks", "idempotency"] {
        t.execute(&format!("DELETE FROM {table} WHERE job_id = $1"), &[id.into()])?;
    }
    t.execute("DELETE FROM jobs WHERE id = $1", &[id.into()])?;
    drop_unused(t, &blobs)?;
    Ok(Removed::Gone)
}

fn remove_upload(t: &mut Transaction, id: &str) -> Result<Removed, StoreError> {
    let blobs = t.query("SELECT DISTINCT sha FROM upload_files WHERE upload_id = $1", &[id.into()])?;
    let readers = t.query(
        "SELECT 1 FROM job_inputs i JOIN jobs j ON j.id = i.job_id \
         WHERE i.upload_id = $1 AND j.state IN ('queued', 'running') LIMIT 1",
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
             AND NOT EXISTS (SELECT 1 FROM results WHERE result_sha = $1) \
             AND NOT EXISTS (SELECT 1 FROM result_files WHERE sha = $1)",
            &[Value::from(sha)],
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::store::blobs::put_bytes;
    use crate::service::store::{NewJob, NewTask, NewUpload, Submitted, TaskResult, UploadFile, sha256_hex};
    use std::path::Path;

    fn upload(folder: &Path, id: &str, contents: [&str; 2]) -> NewUpload {
        let file = |(index, content): (usize, &str)| {
            let (name, path) = (format!("file-{index}"), folder.join(format!("{id}-{index}")));
            std::fs::write(&path, content).expect("written");
            UploadFile { name, path, num_bytes: content.len() as u64, sha: sha256_hex(content.as_bytes()) }
        };
        NewUpload {
            id: id.into(),
            owner: "anna".into(),
            title: id.into(),
            manifest: "{}".into(),
            files: contents.into_iter().enumerate().map(file).collect(),
        }
    }

    fn submit(store: &Store, id: &str, input: &str, key: &str) {
        let tasks = vec![NewTask { input: "{}".into(), cache_key: key.into() }];
        let (id, inputs) = (id.to_string(), vec![input.to_string()]);
        let (kind, owner, title) = ("evaluations".into(), "anna".into(), id.clone());
        let job = NewJob { id, kind, owner, title, body: "{}".into(), inputs, tasks, has_gather: false };
        assert_eq!(store.submit(&job, None, 100, None).expect("submitted"), Submitted::New);
    }

    fn finish(store: &Store, text: &str) {
        let task = store.claim("worker", 60_000, "").expect("the storage answers").expect("a task");
        let artefacts = vec![("table.csv".into(), "text/csv".into(), b"shared".to_vec())];
        store.finish(&task, "worker", &TaskResult { result: text.into(), artefacts }).expect("stored");
    }

    fn has(store: &Store, content: &str) -> bool {
        store.blob(&sha256_hex(content.as_bytes())).expect("the storage answers").is_some()
    }

    #[test]
    fn what_is_deleted_takes_its_bytes_with_it_and_no_others() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open_folder(&folder.path().join("data")).expect("a store");
        for (id, contents) in [("one", ["only one", "both"]), ("two", ["only two", "both"])] {
            store.put_upload(&upload(folder.path(), id, contents)).expect("kept");
        }
        submit(&store, "first", "two", "key");
        assert_eq!(store.delete_job("first").expect("an answer"), Removed::InUse);
        assert_eq!(store.delete_upload("two").expect("an answer"), Removed::InUse, "an unfinished job reads it");
        assert_eq!(store.delete_upload("one").expect("an answer"), Removed::Gone);
        assert_eq!(store.delete_upload("one").expect("an answer"), Removed::Missing);
        assert_eq!([has(&store, "only one"), has(&store, "both"), has(&store, "only two")], [false, true, true]);
        finish(&store, "the result");
        // Answered from what is known of the first, it refers to the same bytes.
        submit(&store, "second", "two", "key");
        assert_eq!(store.delete_job("first").expect("an answer"), Removed::Gone);
        assert!(has(&store, "the result") && has(&store, "shared"));
        assert_eq!(store.artefacts("second").expect("an answer").len(), 1);
        assert_eq!(store.delete_job("second").expect("an answer"), Removed::Gone);
        assert!(!has(&store, "the result") && !has(&store, "shared"));
        // What was known went with it: the same is computed again.
        submit(&store, "third", "none", "key");
        assert!(store.claim("worker", 60_000, "").expect("the storage answers").is_some());
    }

    #[test]
    fn what_is_old_and_has_ended_is_deleted() {
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open_folder(&folder.path().join("data")).expect("a store");
        store.put_upload(&upload(folder.path(), "free", ["a", "b"])).expect("kept");
        store.put_upload(&upload(folder.path(), "read", ["c", "d"])).expect("kept");
        submit(&store, "ended", "none", "");
        finish(&store, "done");
        submit(&store, "waiting", "read", "");
        assert_eq!(store.delete_older_than(3_600_000).expect("an answer"), [0, 0], "nothing is an hour old");
        // Everything is older than an hour from now.
        assert_eq!(store.delete_older_than(-3_600_000).expect("an answer"), [1, 1]);
        assert!(store.job("waiting").expect("an answer").is_some());
        assert_eq!(store.uploads(10).expect("an answer").len(), 1);
    }

    /// A job of ten thousand evaluations, each with a result and a file of its own that is known under its content's
    /// key: what is deleted is found by indices, as one look at all results for each of them would take minutes.
    #[test]
    fn ten_thousand_results_are_deleted_in_seconds() {
        const COUNT: usize = 10_000;
        let folder = tempfile::tempdir().expect("a folder");
        let store = Store::open_folder(folder.path()).expect("a store");
        for id in ["deleted", "kept"] {
            let task = |index: usize| NewTask { input: "{}".into(), cache_key: format!("{id}-{index}") };
            let (kind, owner, title, body) = ("sweeps".into(), "anna".into(), id.into(), "{}".into());
            let tasks = (0..COUNT).map(task).collect();
            let job = NewJob { id: id.into(), kind, owner, title, body, inputs: Vec::new(), tasks, has_gather: false };
            store.submit(&job, None, 2 * COUNT, None).expect("submitted");
            let fill = |t: &mut Transaction| {
                for index in 0..COUNT {
                    let (key, index) = (format!("{id}-{index}"), Value::from(index));
                    let [result, file] = ["result", "file"].map(|what| format!("{what} of {key}"));
                    let (result, file) = (put_bytes(t, result.as_bytes())?, put_bytes(t, file.as_bytes())?);
                    t.execute(
                        "UPDATE tasks SET state = 'succeeded', result_sha = $3 WHERE job_id = $1 AND task_index = $2",
                        &[id.into(), index.clone(), (&result).into()],
                    )?;
                    t.execute(
                        "INSERT INTO artefacts VALUES ($1, $2, 'table.csv', 'text/csv', $3, 1)",
                        &[id.into(), index, (&file).into()],
                    )?;
                    t.execute("INSERT INTO results VALUES ($1, $2, 1)", &[(&key).into(), result.into()])?;
                    t.execute(
                        "INSERT INTO result_files VALUES ($1, 'table.csv', 'text/csv', $2, 1)",
                        &[(&key).into(), file.into()],
                    )?;
                }
                t.execute("UPDATE jobs SET state = 'succeeded' WHERE id = $1", &[id.into()])?;
                Ok(())
            };
            store.database.transact(&fill).expect("filled");
        }
        let begin = std::time::Instant::now();
        assert_eq!(store.delete_job("deleted").expect("an answer"), Removed::Gone);
        let seconds = begin.elapsed().as_secs_f64();
        eprintln!("a job of {COUNT} results beside another one was deleted in {seconds:.2} s");
        let left = store.database.read("SELECT count(*) FROM blobs", &[]).expect("an answer")[0].int(0);
        assert_eq!(left, 2 * COUNT as i64, "what the other job refers to");
        // A scan of 20,000 results for each of 20,000 contents takes minutes, the indices about a second.
        assert!(seconds < 20.0, "{seconds:.1} s");
    }
}
