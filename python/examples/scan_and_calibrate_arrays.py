"""A synthetic scan as arrays, and the material found again from arrays."""

# %% A scan of a sheared block, as the scanner would give it
import numpy as np

import lambdak as lk

block = lk.Specimen(
    length_mm=25.4, thickness_mm=6.4, width_mm=19.1, test="double_lap_shear", drive_mm=[2.5, 5.0], samples_in_parallel=2
)
truth = lk.Material([(17.0, 1.91)], bulk_kpa=2173)
# The phase must turn by less than π from voxel to voxel, so coarse voxels need a weak encoding.
scanned = lk.scan(block, truth, voxel_mm=[2.0, 0.6, 2.0], mm_per_radian=[0.4] * 3, noise_sd_mm=[0.02] * 3, seed=3)
measured = scanned.recording
print(measured)

# %% Arrays in, as a laboratory has them: displacement in mm, a mask, drives and forces
recording = lk.Recording(
    block,
    measured.displacement_mm,  # (drives, nx, ny, nz, 3)
    measured.mask,
    voxel_mm=[2.0, 0.6, 2.0],
    origin_mm=lk.centered_origin(measured.mask, [2.0, 0.6, 2.0]),
    drive_mm=[2.5, 5.0],
    force_n=[step.force_n for step in scanned.steps],
    force_sd_n=0.02,
    id="my-scan",
)
assert np.allclose(recording.affine, measured.affine)

# %% The material, with intervals. In a notebook, `calibration` alone shows the table and the pictures.
calibration = lk.calibrate(recording, mesh_factor=1.8, num_terms=1, on_progress=print)
for estimate in calibration.parameters.values():
    low, high = estimate.interval_95
    print(f"{estimate.name}: {estimate.value:.4g} ({low:.4g} to {high:.4g})")
print("report:", calibration.report)

found = calibration.initial_shear_modulus
low, high = found.interval_95
print(f"initial shear modulus: {found.value:.3f} kPa ({low:.3f} to {high:.3f})")
assert low < 0.5 * 17.0 * 1.91 < high

# %% For Abaqus and friends, each in its own convention
cards = lk.export_material(calibration.material, name="Ecoflex_0020").cards
print(cards["abaqus"].text)
