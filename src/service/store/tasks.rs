//! Tasks: claiming, heartbeats, results, failures, checkpoints.

use super::artefact_row::ArtefactRow;
use super::blobs::put_bytes;
use super::{MAX_LOSSES, Store, StoreError, Transaction, Value, lock_job, touch};
use crate::provenance::VERSION;

/// A claimed task.
#[derive(Clone, Debug)]
pub struct Claimed {
    /// Its job.
    pub job_id: String,
    /// Its job's kind.
    pub kind: String,
    /// Its job's body, JSON.
    pub body: String,
    /// From 0.
    pub index: i64,
    /// Whether it puts the others' results together.
    pub is_gather: bool,
    /// Input, JSON.
    pub input: String,
    /// Key of its result's content; empty where results are not shared.
    pub cache_key: String,
    /// This attempt, from 1: only this one's result is taken.
    pub attempt: i64,
}

/// What a task yields.
#[derive(Clone, Debug, Default)]
pub struct TaskResult {
    /// The result, JSON.
    pub result: Vec<u8>,
    /// Name, media type and bytes.
    pub artefacts: Vec<(String, String, Vec<u8>)>,
}

/// What became of a result or a heartbeat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finished {
    /// Taken.
    Taken,
    /// The task is no longer this attempt's: cancelled, or given to another worker.
    NotOurs,
}

impl Store {
    /// Claims the next task for `worker`: short jobs before long ones, then oldest first. A running task whose lease is
    /// over is claimed again; after [`MAX_LOSSES`] it is put aside with `dead_problem`.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn claim(&self, worker: &str, lease_ms: i64, dead_problem: &str) -> Result<Option<Claimed>, StoreError> {
        // A look without locks first: an idle worker does not disturb those that write.
        let waiting = self.database.read(
            "SELECT 1 FROM tasks WHERE state = 'queued' OR (state = 'running' AND lease_ms < {now}) LIMIT 1",
            &[],
        )?;
        if waiting.is_empty() {
            return Ok(None);
        }
        self.database.transact(&|t| {
            loop {
                let rows = t.query(
                    "SELECT t.job_id, t.task_index, t.role, t.input, t.cache_key, t.attempt, t.state, j.kind, j.body, t.losses \
                     FROM tasks t JOIN jobs j ON j.id = t.job_id \
                     WHERE (t.state = 'queued' OR (t.state = 'running' AND t.lease_ms < {now})) AND j.version = $1 \
                     AND (t.cache_key = '' OR NOT EXISTS (SELECT 1 FROM tasks r WHERE r.cache_key = t.cache_key \
                     AND r.state = 'running' AND NOT (r.job_id = t.job_id AND r.task_index = t.task_index))) \
                     ORDER BY CASE WHEN j.num_tasks > 1 THEN 1 ELSE 0 END, j.created_ms, t.job_id, t.task_index \
                     LIMIT 1 {skip_locked}",
                    &[VERSION.into()],
                )?;
                let Some(r) = rows.first() else { return Ok(None) };
                let (job, index, attempt) = (r.text(0), r.int(1), r.int(5) + 1);
                let losses = r.int(9) + i64::from(r.text(6) == "running");
                if losses >= MAX_LOSSES {
                    fail_task(t, &job, index, dead_problem)?;
                    continue;
                }
                let cache_key = r.text(4);
                if !cache_key.is_empty() && finish_from_known(t, &job, index, &cache_key)? {
                    continue;
                }
                t.execute(
                    "UPDATE tasks SET state = 'running', attempt = $3, worker = $4, lease_ms = {now} + $5, \
                     losses = $6, started_ms = {now} WHERE job_id = $1 AND task_index = $2",
                    &[Value::from(&job), index.into(), attempt.into(), worker.into(), lease_ms.into(), losses.into()],
                )?;
                let first = t.execute(
                    "UPDATE jobs SET state = 'running', started_ms = CASE WHEN started_ms = 0 THEN {now} \
                     ELSE started_ms END WHERE id = $1 AND state = 'queued'",
                    &[Value::from(&job)],
                )?;
                if first > 0 {
                    touch(t, &job)?;
                }
                return Ok(Some(Claimed {
                    job_id: job,
                    kind: r.text(7),
                    body: r.text(8),
                    index,
                    is_gather: r.text(2) == "gather",
                    input: r.text(3),
                    cache_key,
                    attempt,
                }));
            }
        })
    }

    /// Prolongs the lease and stores progress (JSON; empty for none).
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn heartbeat(
        &self,
        task: &Claimed,
        worker: &str,
        lease_ms: i64,
        progress: &str,
    ) -> Result<Finished, StoreError> {
        self.database.transact(&|t| {
            let kept = t.execute(
                "UPDATE tasks SET lease_ms = {now} + $5 WHERE job_id = $1 AND task_index = $2 AND attempt = $3 \
                 AND worker = $4 AND state = 'running'",
                &[(&task.job_id).into(), task.index.into(), task.attempt.into(), worker.into(), lease_ms.into()],
            )?;
            if kept == 0 {
                return Ok(Finished::NotOurs);
            }
            if !progress.is_empty() {
                let changed = t.execute(
                    "UPDATE jobs SET progress = $2 WHERE id = $1 AND progress <> $2",
                    &[(&task.job_id).into(), progress.into()],
                )?;
                if changed > 0 {
                    touch(t, &task.job_id)?;
                }
            }
            Ok(Finished::Taken)
        })
    }

    /// Takes a task's result, from the attempt that holds it only. Everything (result, artefacts, what is known under
    /// its key, the job's state) is one transaction.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn finish(&self, task: &Claimed, worker: &str, result: &TaskResult) -> Result<Finished, StoreError> {
        self.database.transact(&|t| {
            lock_job(t, &task.job_id)?;
            if !is_ours(t, task, worker)? {
                return Ok(Finished::NotOurs);
            }
            let sha = put_bytes(t, &result.result)?;
            let mut files = Vec::new();
            for (name, media_type, bytes) in &result.artefacts {
                files.push(ArtefactRow {
                    name: name.clone(),
                    media_type: media_type.clone(),
                    sha: put_bytes(t, bytes)?,
                    num_bytes: bytes.len() as i64,
                });
            }
            if !task.cache_key.is_empty() {
                remember(t, &task.cache_key, &sha, &files)?;
            }
            complete(t, &task.job_id, task.index, task.is_gather, &sha, &files)?;
            Ok(Finished::Taken)
        })
    }

    /// A task that cannot succeed.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn fail(&self, task: &Claimed, worker: &str, problem: &str) -> Result<Finished, StoreError> {
        self.database.transact(&|t| {
            lock_job(t, &task.job_id)?;
            if !is_ours(t, task, worker)? {
                return Ok(Finished::NotOurs);
            }
            fail_task(t, &task.job_id, task.index, problem)?;
            Ok(Finished::Taken)
        })
    }

    /// Gives a task back (at shutdown), without counting the attempt's end as a failure.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn release(&self, task: &Claimed, worker: &str) -> Result<(), StoreError> {
        self.database.transact(&|t| {
            t.execute(
                "UPDATE tasks SET state = 'queued', worker = '', lease_ms = 0 WHERE job_id = $1 AND task_index = $2 \
                 AND attempt = $3 AND worker = $4 AND state = 'running'",
                &[(&task.job_id).into(), task.index.into(), task.attempt.into(), worker.into()],
            )?;
            Ok(())
        })
    }

    /// Keeps a task's checkpoint, from the attempt that holds it only.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn save_checkpoint(&self, task: &Claimed, worker: &str, bytes: &[u8]) -> Result<Finished, StoreError> {
        self.database.transact(&|t| {
            // A worker that is stopping has been cancelled or fenced already: its last lines may still be used where
            // nobody else holds the task.
            let rows = t.query(
                "SELECT attempt, worker FROM tasks WHERE job_id = $1 AND task_index = $2",
                &[(&task.job_id).into(), task.index.into()],
            )?;
            let Some(row) = rows.first() else { return Ok(Finished::NotOurs) };
            if row.int(0) != task.attempt || row.text(1) != worker {
                return Ok(Finished::NotOurs);
            }
            t.execute(
                "INSERT INTO checkpoints (job_id, task_index, bytes) VALUES ($1, $2, $3) \
                 ON CONFLICT (job_id, task_index) DO UPDATE SET bytes = excluded.bytes",
                &[(&task.job_id).into(), task.index.into(), bytes.to_vec().into()],
            )?;
            // A task that gets on is not one that ends its workers.
            t.execute(
                "UPDATE tasks SET losses = 0 WHERE job_id = $1 AND task_index = $2",
                &[(&task.job_id).into(), task.index.into()],
            )?;
            Ok(Finished::Taken)
        })
    }

    /// A task's checkpoint.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn checkpoint(&self, task: &Claimed) -> Result<Option<Vec<u8>>, StoreError> {
        let rows = self.database.read(
            "SELECT bytes FROM checkpoints WHERE job_id = $1 AND task_index = $2",
            &[(&task.job_id).into(), task.index.into()],
        )?;
        Ok(rows.first().map(|r| r.blob(0)))
    }

    /// Results and problems of a job's tasks in order: (result JSON or empty, problem JSON or empty).
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn task_results(&self, job: &str) -> Result<Vec<(Vec<u8>, String)>, StoreError> {
        let rows = self.database.read(
            "SELECT t.task_index, t.problem, p.part, p.bytes FROM tasks t LEFT JOIN blob_parts p ON p.sha = t.result_sha \
             WHERE t.job_id = $1 AND t.role = 'task' ORDER BY t.task_index, p.part",
            &[job.into()],
        )?;
        let mut results: Vec<(Vec<u8>, String)> = Vec::new();
        for row in &rows {
            // A result of several parts has several rows.
            match results.last_mut() {
                Some(last) if row.int(2) > 0 => last.0.extend(row.blob(3)),
                _ => results.push((row.blob(3), row.text(1))),
            }
        }
        Ok(results)
    }

    /// Says that a worker lives.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn worker_seen(&self, worker: &str, slots: usize) -> Result<(), StoreError> {
        self.database.transact(&|t| {
            t.execute(
                "INSERT INTO workers (id, version, slots, last_seen_ms) VALUES ($1, $2, $3, {now}) \
                 ON CONFLICT (id) DO UPDATE SET last_seen_ms = excluded.last_seen_ms",
                &[worker.into(), VERSION.into(), slots.into()],
            )?;
            t.execute("DELETE FROM workers WHERE last_seen_ms < {now} - 86400000", &[])?;
            t.execute("DELETE FROM idempotency WHERE created_ms < {now} - 604800000", &[])?;
            Ok(())
        })
    }

    /// Workers seen within a minute.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn num_workers(&self) -> Result<i64, StoreError> {
        let rows = self.database.read("SELECT count(*) FROM workers WHERE last_seen_ms > {now} - 60000", &[])?;
        Ok(rows.first().map_or(0, |r| r.int(0)))
    }
}

/// Keeps a result and its files under the key of its content.
fn remember(t: &mut Transaction, cache_key: &str, sha: &str, files: &[ArtefactRow]) -> Result<(), StoreError> {
    let made = t.execute(
        "INSERT INTO results (cache_key, result_sha, created_ms) VALUES ($1, $2, {now}) ON CONFLICT DO NOTHING",
        &[cache_key.into(), sha.into()],
    )?;
    if made == 0 {
        return Ok(());
    }
    for file in files {
        t.execute(
            "INSERT INTO result_files (cache_key, name, media_type, sha, num_bytes) VALUES ($1, $2, $3, $4, $5)",
            &[
                cache_key.into(),
                (&file.name).into(),
                (&file.media_type).into(),
                (&file.sha).into(),
                file.num_bytes.into(),
            ],
        )?;
    }
    Ok(())
}

fn is_ours(t: &mut Transaction, task: &Claimed, worker: &str) -> Result<bool, StoreError> {
    let held = t.execute(
        "UPDATE tasks SET worker = worker WHERE job_id = $1 AND task_index = $2 AND attempt = $3 AND worker = $4 \
         AND state = 'running'",
        &[(&task.job_id).into(), task.index.into(), task.attempt.into(), worker.into()],
    )?;
    Ok(held == 1)
}

/// Finishes a task from what is known under its key; false where nothing is.
pub(super) fn finish_from_known(
    t: &mut Transaction,
    job: &str,
    index: i64,
    cache_key: &str,
) -> Result<bool, StoreError> {
    let select = "SELECT result_sha FROM results WHERE cache_key = $1";
    let mut rows = t.query(select, &[cache_key.into()])?;
    let mut files = Vec::new();
    match cache_key.strip_suffix(super::NUMBERS_ONLY) {
        Some(full) if rows.is_empty() => rows = t.query(select, &[full.into()])?,
        _ => {
            let columns = "SELECT name, media_type, sha, num_bytes FROM result_files WHERE cache_key = $1";
            files.extend(t.query(columns, &[cache_key.into()])?.iter().map(ArtefactRow::of));
        }
    }
    let Some(row) = rows.first() else { return Ok(false) };
    t.execute("UPDATE jobs SET started_ms = {now} WHERE id = $1 AND started_ms = 0", &[job.into()])?;
    complete(t, job, index, false, &row.text(0), &files)?;
    Ok(true)
}

fn complete(
    t: &mut Transaction,
    job: &str,
    index: i64,
    is_gather: bool,
    sha: &str,
    artefacts: &[ArtefactRow],
) -> Result<(), StoreError> {
    t.execute(
        "UPDATE tasks SET state = 'succeeded', result_sha = $3, problem = '', completions = completions + 1, \
         finished_ms = {now} WHERE job_id = $1 AND task_index = $2",
        &[job.into(), index.into(), sha.into()],
    )?;
    let rows = t.query("SELECT num_tasks FROM jobs WHERE id = $1", &[job.into()])?;
    let is_single = rows.first().map_or(0, |r| r.int(0)) == 1;
    for a in artefacts {
        // Artefacts of one of many tasks carry its number, so that names stay unique in the job.
        let name = if is_gather || is_single { a.name.clone() } else { format!("task-{index:05}-{}", a.name) };
        t.execute(
            "INSERT INTO artefacts (job_id, task_index, name, media_type, sha, num_bytes) \
             VALUES ($1, $2, $3, $4, $5, $6) ON CONFLICT DO NOTHING",
            &[job.into(), index.into(), name.into(), (&a.media_type).into(), (&a.sha).into(), a.num_bytes.into()],
        )?;
    }
    t.execute("DELETE FROM checkpoints WHERE job_id = $1 AND task_index = $2", &[job.into(), index.into()])?;
    let has_gather = t.query("SELECT 1 FROM tasks WHERE job_id = $1 AND role = 'gather'", &[job.into()])?;
    if is_gather || has_gather.is_empty() {
        t.execute(
            "UPDATE jobs SET state = 'succeeded', result_sha = $2, finished_ms = {now}, \
             num_done = CASE WHEN num_tasks = 1 THEN 1 ELSE num_done END WHERE id = $1",
            &[job.into(), sha.into()],
        )?;
    } else {
        t.execute("UPDATE jobs SET num_done = num_done + 1 WHERE id = $1", &[job.into()])?;
        release_gather(t, job)?;
    }
    touch(t, job)
}

/// Ends a task with a problem; without a gathering task the job ends with it.
fn fail_task(t: &mut Transaction, job: &str, index: i64, problem: &str) -> Result<(), StoreError> {
    t.execute(
        "UPDATE tasks SET state = 'failed', problem = $3, finished_ms = {now} WHERE job_id = $1 AND task_index = $2",
        &[job.into(), index.into(), problem.into()],
    )?;
    let rows = t.query(
        "SELECT role FROM tasks WHERE job_id = $1 AND task_index <> $2 AND role = 'gather'",
        &[job.into(), index.into()],
    )?;
    if rows.is_empty() {
        t.execute(
            "UPDATE jobs SET state = 'failed', problem = $2, finished_ms = {now} WHERE id = $1 \
             AND state IN ('queued', 'running')",
            &[job.into(), problem.into()],
        )?;
    } else {
        t.execute("UPDATE jobs SET num_done = num_done + 1 WHERE id = $1", &[job.into()])?;
        release_gather(t, job)?;
    }
    touch(t, job)
}

/// Queues the gathering task once all others have ended.
pub(super) fn release_gather(t: &mut Transaction, job: &str) -> Result<(), StoreError> {
    t.execute(
        "UPDATE tasks SET state = 'queued' WHERE job_id = $1 AND role = 'gather' AND state = 'waiting' \
         AND NOT EXISTS (SELECT 1 FROM tasks o WHERE o.job_id = $1 AND o.role = 'task' \
         AND o.state NOT IN ('succeeded', 'failed'))",
        &[job.into()],
    )?;
    Ok(())
}
