INSERT INTO blob_parts (sha, part, bytes) SELECT sha, 0, bytes FROM blobs;
ALTER TABLE blobs DROP COLUMN bytes;
INSERT INTO job_inputs (job_id, upload_id)
    SELECT j.id, u.id FROM jobs j JOIN uploads u ON j.body LIKE '%' || u.id || '%';
UPDATE meta SET value = '2' WHERE key = 'schema';
