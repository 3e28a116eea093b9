"""What a scan of a specimen would see, and how well it would tell the material's parameters."""

# %% The published two-hole double-lap shear specimen
import lambdak as lk

specimen = lk.Specimen(
    name="two-hole double-lap shear",
    length_mm=25.4,
    thickness_mm=6.4,
    width_mm=19.1,
    test="double_lap_shear",
    drive_mm=[5.0],
    holes=[lk.Hole((-4.2333, 0), 5.0), lk.Hole((4.2333, 0), 5.0)],
    samples_in_parallel=2,
)
material = lk.Material([(17.0, 1.91)], bulk_kpa=2173)
scanner = lk.ScanSettings(voxel_mm=(1.0, 0.1875, 0.75), noise_sd_mm=(0.05, 0.05, 0.05), force_sd_n=0.02)

# %% One scan at 5 mm
evaluation = lk.evaluate(specimen, material, scan=scanner, mesh="search")
step = evaluation.steps[0]
print(f"{step.num_voxels} voxels, median stretch {step.median_stretch:.3f}, force {step.force_n:.2f} N")
for promised in evaluation.promised_sd.values():
    print(f"{promised.parameter}: ± {100 * promised.relative_sd:.2f} %")
print("pictures:", ", ".join(path.name for path in evaluation.pictures))

# %% Forces read on the way to the scan take no time in the scanner, and tell more of the exponent.
with_forces = lk.evaluate(specimen, material, scan=scanner, mesh="search", protocol={"force_drive_mm": [1, 2, 3, 4]})
before, after = evaluation.promised_sd["alpha_1"], with_forces.promised_sd["alpha_1"]
print(f"alpha_1 with forces at 1, 2, 3, 4 mm: ± {100 * after.relative_sd:.2f} %")

assert after.value < before.value
