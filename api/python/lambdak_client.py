"""A thin client of lambdak's service. Standard library only.

    from lambdak_client import Client
    service = Client("http://127.0.0.1:8080")
    job = service.evaluate(specimen, material)
    print(job.result()["steps"][0]["force_n"])
"""

import json
import time
import urllib.error
import urllib.request


class ProblemError(Exception):
    """An RFC 9457 problem of the service."""

    def __init__(self, problem):
        super().__init__(f"{problem.get('title')}: {problem.get('detail')}")
        self.problem = problem
        self.kind = problem.get("type", "").rsplit(":", 1)[-1]
        self.pointers = [error["pointer"] for error in problem.get("errors", [])]


# A request that is told to come back later than this is not tried again: the caller decides.
LONGEST_WAIT_S = 30.0


class Client:
    """The service at `base`, with a token where it needs one."""

    def __init__(self, base, token=None, timeout_s=60):
        self.base, self.token, self.timeout_s = base.rstrip("/"), token, timeout_s

    def request(self, method, path, body=None, headers=None, raw=None):
        """Bytes and headers of an answer; waits and tries again when told to come back soon (429, 503)."""
        headers = dict(headers or {})
        if self.token:
            headers["authorization"] = f"Bearer {self.token}"
        data = raw
        if body is not None:
            data = json.dumps(body).encode()
            headers["content-type"] = "application/json"
        for attempt in range(6):
            request = urllib.request.Request(self.base + path, data, headers, method=method)
            try:
                with urllib.request.urlopen(request, timeout=self.timeout_s) as answer:
                    return answer.read(), answer.headers
            except urllib.error.HTTPError as error:
                text = error.read()
                try:
                    problem = json.loads(text)
                except ValueError:
                    problem = {"title": error.reason, "detail": text.decode(errors="replace")}
                wait = float(error.headers.get("retry-after") or "inf")
                if error.code in (429, 503) and attempt < 5 and wait <= LONGEST_WAIT_S:
                    time.sleep(wait)
                    continue
                raise ProblemError(problem) from None

    def get(self, path):
        return json.loads(self.request("GET", path)[0])

    def post(self, path, body=None, headers=None):
        return json.loads(self.request("POST", path, {} if body is None else body, headers)[0])

    def submit(self, kind, body, key=None):
        """A job of a kind: evaluations, sweeps, designs, scans, calibrations, diagnoses. Equal keys give the same job."""
        headers = {"idempotency-key": key} if key else {}
        return Job(self, self.post(f"/v1/{kind}", body, headers)["id"])

    def evaluate(self, specimen, material, **more):
        return self.submit("evaluations", {"specimen": specimen, "material": material, **more})

    def sweep(self, base, vary, name="sweep"):
        """`vary`: {"/specimen/holes/0/diameter_mm": [3, 4, 5]}; all combinations."""
        axes = [{"pointer": pointer, "values": list(values)} for pointer, values in vary.items()]
        return self.submit("sweeps", {"name": name, "base": base, "vary": axes})

    def sample(self, base, ranges, count, seed=0, name="sample"):
        """`ranges`: {"/specimen/holes/0/diameter_mm": (3, 5)}; a Latin hypercube of `count` points."""
        axes = [{"pointer": pointer, "range": list(ends)} for pointer, ends in ranges.items()]
        body = {"name": name, "base": base, "vary": axes, "sample": {"count": count, "seed": seed}}
        return self.submit("sweeps", body)

    def design(self, study):
        return self.submit("designs", study)

    def upload(self, folder):
        """A recording's folder; returns its identifier."""
        import io
        import pathlib
        import tarfile

        buffer = io.BytesIO()
        with tarfile.open(fileobj=buffer, mode="w", format=tarfile.USTAR_FORMAT) as archive:
            for path in sorted(pathlib.Path(folder).iterdir()):
                if path.is_file() and not path.name.startswith("."):
                    archive.add(path, arcname=path.name)
        body, _ = self.request("POST", "/v1/recordings", raw=buffer.getvalue(), headers={"content-type": "application/x-tar"})
        return json.loads(body)["id"]

    def scan(self, specimen, material, **more):
        """A synthetic scan; its result's `recording` is the identifier of the recording it made."""
        return self.submit("scans", {"specimen": specimen, "material": material, **more})

    def delete_recording(self, id):
        self.request("DELETE", f"/v1/recordings/{id}")

    def recording(self, id):
        return self.get(f"/v1/recordings/{id}")

    def calibrate(self, recordings, **more):
        """A calibration on recordings of the service, all fitted together."""
        ids = [recordings] if isinstance(recordings, str) else list(recordings)
        return self.submit("calibrations", {"recordings": ids, **more})

    def diagnose(self, recording, material=None, **more):
        """A diagnosis of an uploaded recording."""
        body = {"recording": recording, **more}
        if material is not None:
            body["material"] = material
        return self.submit("diagnoses", body)

    def check(self, specimen, limits=None, **more):
        body = {"specimen": specimen, **more}
        if limits is not None:
            body["limits"] = limits
        return self.post("/v1/specimens/check", body)

    def library(self):
        return self.get("/v1/library")

    def job(self, id):
        return Job(self, id)


class Job:
    """A job of the service."""

    def __init__(self, client, id):
        self.client, self.id = client, id

    def view(self):
        return self.client.get(f"/v1/jobs/{self.id}")

    def wait(self, timeout_s=3600, show=None):
        """The job's view once it has ended; `show(view)` for every look."""
        end = time.monotonic() + timeout_s
        pause = 0.1
        while True:
            view = self.view()
            if show:
                show(view)
            if view["state"] not in ("queued", "running"):
                return view
            if time.monotonic() > end:
                raise TimeoutError(f"job {self.id} is {view['state']} after {timeout_s} s")
            time.sleep(pause)
            pause = min(2.0, 1.3 * pause)

    def result(self, timeout_s=3600):
        view = self.wait(timeout_s)
        if view["state"] != "succeeded":
            raise ProblemError(view.get("problem", {"title": view["state"], "detail": f"job {self.id}"}))
        return self.client.get(f"/v1/jobs/{self.id}/result")

    def cancel(self):
        return self.client.post(f"/v1/jobs/{self.id}/cancel")

    def delete(self):
        """Deletes the job, once it has ended, with its results."""
        self.client.request("DELETE", f"/v1/jobs/{self.id}")

    def resume(self):
        return self.client.post(f"/v1/jobs/{self.id}/resume")

    def artefacts(self):
        return self.client.get(f"/v1/jobs/{self.id}/artefacts")["artefacts"]

    def file(self, name):
        return self.client.request("GET", f"/v1/jobs/{self.id}/artefacts/{name}")[0]
