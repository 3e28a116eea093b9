"""Plan, sweep, scan, calibrate and diagnose over the service; run it as `python3 example.py http://127.0.0.1:8080 [TOKEN]`."""

import sys

from lambdak_client import Client, ProblemError

service = Client(*sys.argv[1:3])
library = service.library()
study = library["studies"][0]
specimen, material, scan = study["base"], library["materials"][0]["material"], study["scan"]

# %% Can it be made, and what would it cost?
found = service.check(specimen, study["limits"], voxel_mm=scan["voxel_mm"])
print("can be made:", found["is_valid"], "· closest limit:", found["margins"][0]["name"])

# %% A mistake is pointed at.
wrong = {**specimen, "drive_mm": [0.0]}
try:
    service.evaluate(wrong, material)
except ProblemError as error:
    print("refused:", error.kind, error.pointers)
    assert error.pointers == ["/specimen/drive_mm/0"]

# %% What would the scan tell?
job = service.evaluate(specimen, material, scan=scan, drive_mm=[5.0], mesh="search")
evaluation = job.result()
for p in evaluation["promised_sd"]:
    print(f"promised standard deviation of {p['parameter']}: {p['value']}")
print("files:", ", ".join(a["name"] for a in job.artefacts()))

# %% How does it depend on the holes' diameter?
base = {"specimen": specimen, "material": material, "scan": scan, "drive_mm": [5.0], "mesh": "search"}
diameters = [3.0, 4.0, 5.0]
sweep = service.sweep(base, {"/specimen/holes/0/diameter_mm": diameters}).result()
for diameter, entry in zip(diameters, sweep["evaluations"]):
    print(f"first hole {diameter} mm: force {entry['evaluation']['steps'][0]['force_n']:.3f} N")

# %% And at random diameters? The table is a file too: CSV, or Parquet for pandas and friends.
ranges = {"/specimen/holes/0/diameter_mm": (3.0, 5.0), "/specimen/holes/1/diameter_mm": (3.0, 5.0)}
sample = service.sample(base, ranges, count=2, seed=7)
assert sample.result()["varied"] == list(ranges)
print("table:", sample.file("table.csv").decode().splitlines()[0])
assert sample.file("table.parquet")[:4] == b"PAR1"

# %% Scan a block as the scanner would, with noise, and find the material again.
block = {**library["specimens"][1], "drive_mm": [2.5, 5.0]}
# The phase must turn by less than π from voxel to voxel, so coarse voxels need a weak encoding.
coarse = {"voxel_mm": [2.0, 0.6, 2.0], "mm_per_radian": [0.4] * 3, "noise_sd_mm": [0.01] * 3}
scanned = service.scan(block, material, mesh="search", seed=3, **coarse).result()
recording = scanned["recording"]
print("recording:", service.recording(recording)["summary"]["num_voxels"], "voxels")
calibration = service.calibrate(recording, num_terms=1, mesh_factor=2.0, has_mesh_allowance=False, num_starts=1)
found = calibration.result()
for p in found["parameters"]:
    print(f"{p['name']}: {p['value']} ± {p['sd']}")
truth = 0.5 * sum(t["mu_kpa"] * t["alpha"] for t in material["terms"])
# The scan was made on a finer mesh than the fit's: a few per cent lie between them.
assert abs(found["initial_shear_modulus_kpa"]["value"] / truth - 1) < 0.1
print("files:", ", ".join(a["name"] for a in calibration.artefacts()))

# %% Does anything but the material explain the recording? Nothing should.
diagnosis = service.diagnose(recording, material, mesh_factor=2.0, max_causes=1)
print("verdict:", diagnosis.result()["verdict"])
print("images:", ", ".join(a["name"] for a in diagnosis.artefacts() if a["name"].endswith(".nii.gz")))

# %% A better one, with a small budget and of one material alone, not of those that it may turn out to be.
one_material = {**study["materials"][0], "relative_sd": 0.0}
small = {**study, "materials": [one_material], "verification": {"is_on": False, "draws": 1}}
small["budget"] = {"explore": 6, "confirm": 1, "variants_in_search": False}
design = service.design(small)
result = design.result()
print("gain of the best over the base:", round(result["best"]["objective"], 3))
print("drawing:", len(design.file("best-specimen.dxf")), "bytes of DXF")
