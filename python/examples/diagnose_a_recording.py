"""A wrong calibration of one encoding gradient, found from the recording."""

# %% A scan of a sheared block, as the scanner would give it
import lambdak as lk

block = lk.Specimen(
    length_mm=25.4, thickness_mm=6.4, width_mm=19.1, test="double_lap_shear", drive_mm=[2.5, 5.0], samples_in_parallel=2
)
truth = lk.Material([(17.0, 1.91)], bulk_kpa=2173)
scanned = lk.scan(block, truth, voxel_mm=[2.0, 0.6, 2.0], mm_per_radian=[0.4] * 3, noise_sd_mm=[0.02] * 3, seed=3)
good = scanned.recording

# %% Nothing is wrong with the scan as it came.
diagnosis = lk.diagnose(good, truth, mesh_factor=2, max_causes=1, on_progress=print)
print("as it came:", diagnosis.verdict)
assert diagnosis.verdict == "no_mismatch"

# %% The same scan with displacements along the length that are 10 % too large
enlarged = good.displacement_mm.copy()
enlarged[..., 0] *= 1.1
wrong = lk.Recording(
    block,
    enlarged,
    good.mask,
    affine=good.affine,
    drive_mm=good.drive_mm,
    force_n=good.force_n,
    force_sd_n=good.force_sd_n,
    noise_sd_mm=good.noise_sd_mm,
)
diagnosis = lk.diagnose(wrong, truth, mesh_factor=2, max_causes=1)
print("with the gain error:", diagnosis.verdict)
for cause in diagnosis.causes:
    print(f"{cause.name} ({cause.category}): {cause.description}")
    for parameter in cause.parameters.values():
        print(f"   {parameter.name}: {parameter.value:.4g} in {parameter.interval_95}")
    print("   what to do:", cause.remedy)
print("report:", diagnosis.report)

assert [cause.name for cause in diagnosis.causes] == ["gain"]
low, high = diagnosis.causes[0].parameters["relative_gain_error_x"].interval_95
assert low < 0.1 < high
