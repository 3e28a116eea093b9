CREATE TABLE IF NOT EXISTS meta (key TEXT PRIMARY KEY, value TEXT NOT NULL);
CREATE TABLE IF NOT EXISTS revisions (id BIGINT PRIMARY KEY, last BIGINT NOT NULL);
CREATE TABLE IF NOT EXISTS jobs (
    id TEXT PRIMARY KEY, kind TEXT NOT NULL, owner TEXT NOT NULL, title TEXT NOT NULL, body TEXT NOT NULL,
    version TEXT NOT NULL, state TEXT NOT NULL, num_tasks BIGINT NOT NULL, num_done BIGINT NOT NULL,
    progress TEXT NOT NULL, problem TEXT NOT NULL, result_sha TEXT NOT NULL, cancel_requested BIGINT NOT NULL,
    created_ms BIGINT NOT NULL, started_ms BIGINT NOT NULL, finished_ms BIGINT NOT NULL, revision BIGINT NOT NULL);
CREATE INDEX IF NOT EXISTS jobs_by_revision ON jobs (revision);
CREATE INDEX IF NOT EXISTS jobs_by_creation ON jobs (created_ms, id);
CREATE INDEX IF NOT EXISTS jobs_by_state ON jobs (state);
CREATE TABLE IF NOT EXISTS tasks (
    job_id TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE, task_index BIGINT NOT NULL, role TEXT NOT NULL,
    state TEXT NOT NULL, input TEXT NOT NULL, cache_key TEXT NOT NULL, attempt BIGINT NOT NULL, losses BIGINT NOT NULL, worker TEXT NOT NULL,
    lease_ms BIGINT NOT NULL, problem TEXT NOT NULL, result_sha TEXT NOT NULL, completions BIGINT NOT NULL,
    started_ms BIGINT NOT NULL, finished_ms BIGINT NOT NULL, PRIMARY KEY (job_id, task_index));
CREATE INDEX IF NOT EXISTS tasks_by_state ON tasks (state);
CREATE UNIQUE INDEX IF NOT EXISTS tasks_running_once ON tasks (cache_key) WHERE state = 'running' AND cache_key <> '';
CREATE TABLE IF NOT EXISTS job_inputs (
    job_id TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE, upload_id TEXT NOT NULL, PRIMARY KEY (job_id, upload_id));
CREATE TABLE IF NOT EXISTS blobs (sha TEXT PRIMARY KEY, num_bytes BIGINT NOT NULL);
CREATE TABLE IF NOT EXISTS blob_parts (
    sha TEXT NOT NULL REFERENCES blobs (sha) ON DELETE CASCADE, part BIGINT NOT NULL, bytes BLOB NOT NULL,
    PRIMARY KEY (sha, part));
CREATE TABLE IF NOT EXISTS artefacts (
    job_id TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE, task_index BIGINT NOT NULL, name TEXT NOT NULL,
    media_type TEXT NOT NULL, sha TEXT NOT NULL, num_bytes BIGINT NOT NULL, PRIMARY KEY (job_id, task_index, name));
CREATE TABLE IF NOT EXISTS results (
    cache_key TEXT PRIMARY KEY, result_sha TEXT NOT NULL, created_ms BIGINT NOT NULL);
CREATE TABLE IF NOT EXISTS result_files (
    cache_key TEXT NOT NULL REFERENCES results (cache_key) ON DELETE CASCADE, name TEXT NOT NULL,
    media_type TEXT NOT NULL, sha TEXT NOT NULL, num_bytes BIGINT NOT NULL, PRIMARY KEY (cache_key, name));
CREATE TABLE IF NOT EXISTS checkpoints (
    job_id TEXT NOT NULL REFERENCES jobs (id) ON DELETE CASCADE, task_index BIGINT NOT NULL, bytes BLOB NOT NULL,
    PRIMARY KEY (job_id, task_index));
CREATE TABLE IF NOT EXISTS idempotency (
    owner TEXT NOT NULL, key TEXT NOT NULL, fingerprint TEXT NOT NULL, job_id TEXT NOT NULL, created_ms BIGINT NOT NULL,
    PRIMARY KEY (owner, key));
CREATE TABLE IF NOT EXISTS workers (
    id TEXT PRIMARY KEY, version TEXT NOT NULL, slots BIGINT NOT NULL, last_seen_ms BIGINT NOT NULL);
CREATE TABLE IF NOT EXISTS uploads (
    id TEXT PRIMARY KEY, owner TEXT NOT NULL, title TEXT NOT NULL, manifest TEXT NOT NULL, num_bytes BIGINT NOT NULL,
    created_ms BIGINT NOT NULL);
CREATE TABLE IF NOT EXISTS upload_files (
    upload_id TEXT NOT NULL REFERENCES uploads (id) ON DELETE CASCADE, name TEXT NOT NULL, sha TEXT NOT NULL,
    num_bytes BIGINT NOT NULL, PRIMARY KEY (upload_id, name));
CREATE INDEX IF NOT EXISTS tasks_by_result ON tasks (result_sha);
CREATE INDEX IF NOT EXISTS jobs_by_result ON jobs (result_sha);
CREATE INDEX IF NOT EXISTS artefacts_by_content ON artefacts (sha);
CREATE INDEX IF NOT EXISTS upload_files_by_content ON upload_files (sha);
CREATE INDEX IF NOT EXISTS results_by_content ON results (result_sha);
CREATE INDEX IF NOT EXISTS result_files_by_content ON result_files (sha);
CREATE INDEX IF NOT EXISTS job_inputs_by_upload ON job_inputs (upload_id);

