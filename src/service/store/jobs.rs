//! Jobs: submitting, reading, listing, cancelling, resuming.

use super::artefact_row::ArtefactRow;
use super::{Store, StoreError, Transaction, Value, lock_job, next_revision, touch};
use crate::provenance::VERSION;

/// A job to submit.
#[derive(Clone, Debug)]
pub struct NewJob {
    /// Identifier, unguessable.
    pub id: String,
    /// Kind, as in the address.
    pub kind: String,
    /// Name of the token that submits.
    pub owner: String,
    /// For lists.
    pub title: String,
    /// The request's body, JSON.
    pub body: String,
    /// Recordings that it reads.
    pub inputs: Vec<String>,
    /// What there is to run.
    pub tasks: Vec<NewTask>,
    /// Whether a last task puts the others' results together.
    pub has_gather: bool,
}

/// A task to submit.
#[derive(Clone, Debug)]
pub struct NewTask {
    /// Input, JSON.
    pub input: String,
    /// Key of its result's content; empty where results are not shared.
    pub cache_key: String,
}

/// `Idempotency-Key` of a submission.
#[derive(Clone, Debug)]
pub struct Idempotency {
    /// The key.
    pub key: String,
    /// Hash of kind and body.
    pub fingerprint: String,
}

/// What became of a submission.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Submitted {
    /// A new job.
    New,
    /// The same request was made before under the same key: its job.
    Before(String),
    /// Another request was made under the same key.
    KeyUsed,
}

/// A job as stored.
#[derive(Clone, Debug)]
pub struct JobRow {
    /// Identifier.
    pub id: String,
    /// Kind.
    pub kind: String,
    /// Name of the token.
    pub owner: String,
    /// Title.
    pub title: String,
    /// Version of the program.
    pub version: String,
    /// `queued`, `running`, `succeeded`, `failed`, `cancelled`.
    pub state: String,
    /// Tasks, the gathering one not counted.
    pub num_tasks: i64,
    /// Finished ones.
    pub num_done: i64,
    /// Progress, JSON; empty before the first.
    pub progress: String,
    /// Problem, JSON; empty without one.
    pub problem: String,
    /// Result's SHA-256; empty without one.
    pub result_sha: String,
    /// Milliseconds since 1970; 0 where it has not happened.
    pub created_ms: i64,
    /// As above.
    pub started_ms: i64,
    /// As above.
    pub finished_ms: i64,
    /// Grows with every change.
    pub revision: i64,
}

/// A task as stored.
#[derive(Clone, Debug)]
pub struct TaskRow {
    /// From 0.
    pub index: i64,
    /// `queued`, `running`, `succeeded`, `failed`, `cancelled`, `waiting`.
    pub state: String,
    /// Attempts so far.
    pub attempt: i64,
    /// Results taken; never above 1.
    pub completions: i64,
    /// Result's SHA-256; empty without one.
    pub result_sha: String,
    /// Problem, JSON; empty without one.
    pub problem: String,
}

/// Numbers of jobs by (kind, state) and of tasks by state.
pub type Counts = (Vec<(String, String, i64)>, Vec<(String, i64)>);

/// Which jobs to list.
#[derive(Clone, Debug, Default)]
pub struct JobFilter {
    /// Only of this kind; empty for all.
    pub kind: String,
    /// Only in this state; empty for all.
    pub state: String,
    /// Only those created before this job's (created_ms, id), for paging.
    pub before: Option<(i64, String)>,
    /// Most.
    pub limit: usize,
}

const COLUMNS: &str = "id, kind, owner, title, version, state, num_tasks, num_done, progress, problem, result_sha, \
                       created_ms, started_ms, finished_ms, revision";

fn job_of(r: &super::Row) -> JobRow {
    JobRow {
        id: r.text(0),
        kind: r.text(1),
        owner: r.text(2),
        title: r.text(3),
        version: r.text(4),
        state: r.text(5),
        num_tasks: r.int(6),
        num_done: r.int(7),
        progress: r.text(8),
        problem: r.text(9),
        result_sha: r.text(10),
        created_ms: r.int(11),
        started_ms: r.int(12),
        finished_ms: r.int(13),
        revision: r.int(14),
    }
}

/// Ends a job and whatever of it has not ended.
pub(super) fn end_job(t: &mut Transaction, job: &str, state: &str, problem: &str) -> Result<(), StoreError> {
    t.execute(
        "UPDATE tasks SET state = 'cancelled', finished_ms = {now} \
         WHERE job_id = $1 AND state IN ('waiting', 'queued', 'running')",
        &[job.into()],
    )?;
    t.execute(
        "UPDATE jobs SET state = $2, problem = $3, finished_ms = {now} WHERE id = $1 AND state IN ('queued', 'running')",
        &[job.into(), state.into(), problem.into()],
    )?;
    touch(t, job)
}

impl Store {
    /// Puts a job into the queue. Tasks whose results are known are finished at once.
    ///
    /// # Errors
    /// [`StoreError::QueueFull`], [`StoreError`].
    pub fn submit(
        &self,
        job: &NewJob,
        idempotency: Option<&Idempotency>,
        max_queued: usize,
        quota: Option<usize>,
    ) -> Result<Submitted, StoreError> {
        self.database.transact(&|t| {
            if let Some(i) = idempotency {
                let made = t.execute(
                    "INSERT INTO idempotency (owner, key, fingerprint, job_id, created_ms) \
                     VALUES ($1, $2, $3, $4, {now}) ON CONFLICT DO NOTHING",
                    &[(&job.owner).into(), (&i.key).into(), (&i.fingerprint).into(), (&job.id).into()],
                )?;
                if made == 0 {
                    let rows = t.query(
                        "SELECT fingerprint, job_id FROM idempotency WHERE owner = $1 AND key = $2",
                        &[(&job.owner).into(), (&i.key).into()],
                    )?;
                    let before = rows.first().ok_or(StoreError::Corrupt { what: "idempotency key" })?;
                    return Ok(if before.text(0) == i.fingerprint {
                        Submitted::Before(before.text(1))
                    } else {
                        Submitted::KeyUsed
                    });
                }
            }
            check_room(t, job, max_queued, quota)?;
            insert(t, job)?;
            Ok(Submitted::New)
        })
    }

    /// One job.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn job(&self, id: &str) -> Result<Option<JobRow>, StoreError> {
        let rows = self.database.read(&format!("SELECT {COLUMNS} FROM jobs WHERE id = $1"), &[id.into()])?;
        Ok(rows.first().map(job_of))
    }

    /// A job's body.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn job_body(&self, id: &str) -> Result<Option<String>, StoreError> {
        Ok(self.database.read("SELECT body FROM jobs WHERE id = $1", &[id.into()])?.first().map(|r| r.text(0)))
    }

    /// Jobs, newest first.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn jobs(&self, filter: &JobFilter) -> Result<Vec<JobRow>, StoreError> {
        let (before_ms, before_id) = filter.before.clone().unwrap_or((i64::MAX, String::new()));
        let rows = self.database.read(
            &format!(
                "SELECT {COLUMNS} FROM jobs WHERE ($1 = '' OR kind = $1) AND ($2 = '' OR state = $2) \
                 AND (created_ms < $3 OR (created_ms = $3 AND id < $4)) ORDER BY created_ms DESC, id DESC LIMIT $5"
            ),
            &[(&filter.kind).into(), (&filter.state).into(), before_ms.into(), before_id.into(), filter.limit.into()],
        )?;
        Ok(rows.iter().map(job_of).collect())
    }

    /// Jobs changed after a revision, in the order of their changes.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn jobs_changed_since(&self, revision: i64) -> Result<Vec<JobRow>, StoreError> {
        let rows = self.database.read(
            &format!("SELECT {COLUMNS} FROM jobs WHERE revision > $1 ORDER BY revision LIMIT 1000"),
            &[revision.into()],
        )?;
        Ok(rows.iter().map(job_of).collect())
    }

    /// The last revision.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn last_revision(&self) -> Result<i64, StoreError> {
        Ok(self.database.read("SELECT last FROM revisions WHERE id = 1", &[])?.first().map_or(0, |r| r.int(0)))
    }

    /// A job's tasks.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn tasks(&self, job: &str) -> Result<Vec<TaskRow>, StoreError> {
        let rows = self.database.read(
            "SELECT task_index, state, attempt, completions, result_sha, problem FROM tasks \
             WHERE job_id = $1 AND role = 'task' ORDER BY task_index",
            &[job.into()],
        )?;
        Ok(rows
            .iter()
            .map(|r| TaskRow {
                index: r.int(0),
                state: r.text(1),
                attempt: r.int(2),
                completions: r.int(3),
                result_sha: r.text(4),
                problem: r.text(5),
            })
            .collect())
    }

    /// A job's artefacts, by name.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn artefacts(&self, job: &str) -> Result<Vec<ArtefactRow>, StoreError> {
        let rows = self.database.read(
            "SELECT name, media_type, sha, num_bytes FROM artefacts WHERE job_id = $1 ORDER BY name, task_index",
            &[job.into()],
        )?;
        Ok(rows.iter().map(ArtefactRow::of).collect())
    }

    /// Cancels a job that has not ended; a running task is told at its next heartbeat. False where there is no such
    /// job.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn cancel(&self, job: &str) -> Result<bool, StoreError> {
        self.database.transact(&|t| {
            if !lock_job(t, job)? {
                return Ok(false);
            }
            end_job(t, job, "cancelled", "")?;
            Ok(true)
        })
    }

    /// Puts what a failed or cancelled job has not finished back into the queue. False where the job is in no such
    /// state.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn resume(&self, job: &str) -> Result<bool, StoreError> {
        self.database.transact(&|t| {
            if !lock_job(t, job)? {
                return Ok(false);
            }
            let rows = t.query("SELECT state, version FROM jobs WHERE id = $1", &[job.into()])?;
            let Some(row) = rows.first() else { return Ok(false) };
            if !matches!(row.text(0).as_str(), "failed" | "cancelled") {
                return Ok(false);
            }
            if row.text(1) != VERSION {
                // Results of two versions are never mixed.
                t.execute("DELETE FROM artefacts WHERE job_id = $1", &[job.into()])?;
                t.execute("DELETE FROM checkpoints WHERE job_id = $1", &[job.into()])?;
                t.execute(
                    "UPDATE tasks SET state = 'cancelled', result_sha = '', completions = 0 WHERE job_id = $1",
                    &[job.into()],
                )?;
            }
            t.execute(
                "UPDATE tasks SET state = CASE WHEN role = 'gather' THEN 'waiting' ELSE 'queued' END, worker = '', \
                 lease_ms = 0, losses = 0, problem = '' WHERE job_id = $1 AND state IN ('failed', 'cancelled')",
                &[job.into()],
            )?;
            let done = t.query(
                "SELECT count(*) FROM tasks WHERE job_id = $1 AND role = 'task' AND state IN ('succeeded', 'failed')",
                &[job.into()],
            )?;
            let done = done.first().map_or(0, |r| r.int(0));
            t.execute(
                "UPDATE jobs SET state = 'queued', problem = '', finished_ms = 0, num_done = $2, version = $3, \
                 result_sha = '' WHERE id = $1",
                &[job.into(), done.into(), VERSION.into()],
            )?;
            super::tasks::release_gather(t, job)?;
            touch(t, job)?;
            Ok(true)
        })
    }

    /// Numbers of jobs by (kind, state) and of tasks by state, for metrics.
    ///
    /// # Errors
    /// [`StoreError`].
    pub fn counts(&self) -> Result<Counts, StoreError> {
        let jobs = self.database.read("SELECT kind, state, count(*) FROM jobs GROUP BY kind, state", &[])?;
        let tasks = self.database.read("SELECT state, count(*) FROM tasks GROUP BY state", &[])?;
        Ok((
            jobs.iter().map(|r| (r.text(0), r.text(1), r.int(2))).collect(),
            tasks.iter().map(|r| (r.text(0), r.int(1))).collect(),
        ))
    }
}

fn check_room(t: &mut Transaction, job: &NewJob, max_queued: usize, quota: Option<usize>) -> Result<(), StoreError> {
    let mut unfinished = |owner: &str| -> Result<usize, StoreError> {
        let rows = t.query(
            "SELECT count(*) FROM tasks t JOIN jobs j ON j.id = t.job_id \
             WHERE t.state IN ('queued', 'running') AND ($1 = '' OR j.owner = $1)",
            &[owner.into()],
        )?;
        Ok(usize::try_from(rows.first().map_or(0, |r| r.int(0))).unwrap_or(0))
    };
    let queued = unfinished("")? + job.tasks.len();
    if queued > max_queued {
        return Err(StoreError::QueueFull { queued, limit: max_queued, is_quota: false });
    }
    if let Some(limit) = quota {
        let queued = unfinished(&job.owner)? + job.tasks.len();
        if queued > limit {
            return Err(StoreError::QueueFull { queued, limit, is_quota: true });
        }
    }
    Ok(())
}

fn insert(t: &mut Transaction, job: &NewJob) -> Result<(), StoreError> {
    let revision = next_revision(t)?;
    t.execute(
        "INSERT INTO jobs (id, kind, owner, title, body, version, state, num_tasks, num_done, progress, problem, \
         result_sha, cancel_requested, created_ms, started_ms, finished_ms, revision) \
         VALUES ($1, $2, $3, $4, $5, $6, 'queued', $7, 0, '', '', '', 0, {now}, 0, 0, $8)",
        &[
            (&job.id).into(),
            (&job.kind).into(),
            (&job.owner).into(),
            (&job.title).into(),
            (&job.body).into(),
            VERSION.into(),
            job.tasks.len().into(),
            revision.into(),
        ],
    )?;
    for input in &job.inputs {
        t.execute(
            "INSERT INTO job_inputs (job_id, upload_id) VALUES ($1, $2) ON CONFLICT DO NOTHING",
            &[(&job.id).into(), input.into()],
        )?;
    }
    let add = |t: &mut Transaction, index: usize, role: &str, state: &str, input: &str, key: &str| {
        t.execute(
            "INSERT INTO tasks (job_id, task_index, role, state, input, cache_key, attempt, losses, worker, lease_ms, problem, \
             result_sha, completions, started_ms, finished_ms) \
             VALUES ($1, $2, $3, $4, $5, $6, 0, 0, '', 0, '', '', 0, 0, 0)",
            &[
                Value::from(&job.id),
                index.into(),
                role.into(),
                state.into(),
                input.into(),
                key.into(),
            ],
        )
        .map(|_| ())
    };
    for (index, task) in job.tasks.iter().enumerate() {
        add(t, index, "task", "queued", &task.input, &task.cache_key)?;
    }
    if job.has_gather {
        add(t, job.tasks.len(), "gather", "waiting", "{}", "")?;
    }
    for (index, task) in job.tasks.iter().enumerate() {
        if !task.cache_key.is_empty() {
            super::tasks::finish_from_known(t, &job.id, index as i64, &task.cache_key)?;
        }
    }
    Ok(())
}
