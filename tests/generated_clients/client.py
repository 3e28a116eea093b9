"""A program's way through the service with the client that openapi-python-client writes of its document: upload a
recording, calibrate on it, diagnose it, download every file.

    python client.py http://127.0.0.1:8080 FOLDER

FOLDER holds the recording. Needs the generated package lambdak_client.
"""

import hashlib
import io
import pathlib
import sys
import tarfile
import time

from lambdak_client import Client
from lambdak_client.api.jobs import delete_job, get_job, post_calibrations, post_diagnoses
from lambdak_client.api.recordings import delete_recording, get_recording, upload_recording
from lambdak_client.api.results import get_artefact, get_result, list_artefacts
from lambdak_client.models import (
    CalibrationRequest,
    CalibrationResult,
    DiagnosisRequest,
    DiagnosisResult,
    JobState,
    JobView,
    Problem,
    RecordingView,
)
from lambdak_client.types import File

LONG_S = 600

address, folder = sys.argv[1].rstrip("/"), pathlib.Path(sys.argv[2])
client = Client(base_url=address, timeout=120.0)


def packed(folder):
    """A tar file of the folder."""
    tar = io.BytesIO()
    with tarfile.open(fileobj=tar, mode="w") as archive:
        for path in sorted(folder.iterdir()):
            archive.add(path, path.name)
    tar.seek(0)
    return tar


def finished(job):
    """The job, once it has succeeded."""
    assert isinstance(job, JobView), job
    end = time.monotonic() + LONG_S
    while job.state in (JobState.QUEUED, JobState.RUNNING):
        assert time.monotonic() < end, f"{job.id} still runs"
        time.sleep(0.2)
        job = get_job.sync(job.id, client=client)
    assert job.state is JobState.SUCCEEDED, job
    return job


def downloaded(job):
    """Every file of the job, each as long and with the content that the list promises; how many there are."""
    files = list_artefacts.sync(job.id, client=client).artefacts
    for file in files:
        content = get_artefact.sync_detailed(job.id, file.name, client=client).content
        assert (len(content), hashlib.sha256(content).hexdigest()) == (file.num_bytes, file.sha256), file.name
    return len(files)


kept = upload_recording.sync(client=client, body=File(payload=packed(folder)))
assert isinstance(kept, RecordingView), kept
assert get_recording.sync(kept.id, client=client).summary.num_voxels == kept.summary.num_voxels > 0

request = CalibrationRequest(
    recordings=[kept.id], num_terms=1, mesh_factor=4.0, has_mesh_allowance=False, num_starts=1
)
calibration = finished(post_calibrations.sync(client=client, body=request))
found = get_result.sync(calibration.id, client=client)
assert isinstance(found, CalibrationResult), found
modulus = found.initial_shear_modulus_kpa
assert modulus.value > 0 and found.num_terms == 1, found

diagnosis = finished(
    post_diagnoses.sync(client=client, body=DiagnosisRequest(recording=kept.id, mesh_factor=4.0, max_causes=1))
)
what = get_result.sync(diagnosis.id, client=client)
assert isinstance(what, DiagnosisResult), what

count = downloaded(calibration) + downloaded(diagnosis)
assert count > 10, count

# What is wrong is said in types, too.
refused = post_calibrations.sync(client=client, body=CalibrationRequest(recordings=["none"]))
assert isinstance(refused, Problem) and refused.errors[0].pointer == "/recordings/0", refused

for job in (calibration, diagnosis):
    assert delete_job.sync_detailed(job.id, client=client).status_code == 204
assert delete_recording.sync_detailed(kept.id, client=client).status_code == 204
print(
    f"openapi-python-client: uploaded, calibrated ({modulus.value:.2f} kPa), diagnosed ({what.verdict.value}),"
    f" downloaded {count} files"
)
