"""How a hole's diameter changes what a scan tells: a plain loop over specimens."""

# %%
import lambdak as lk

bar = lk.Specimen(length_mm=40, thickness_mm=4, width_mm=12, test="uniaxial", drive_mm=14)
material = lk.Material([(17.0, 1.91)], bulk_kpa=2173)
scanner = lk.ScanSettings(voxel_mm=(1.0, 0.5, 0.5), noise_sd_mm=(0.05, 0.05, 0.05), force_sd_n=0.005)

# %% Without files, each evaluation is numbers alone.
diameters_mm = [2.0, 3.0, 4.0, 5.0, 6.0]
relative_sd = []
for diameter_mm in diameters_mm:
    holed = bar.replace(holes=[lk.Hole((0, 0), diameter_mm)])
    evaluation = lk.evaluate(holed, material, scan=scanner, mesh="search", has_files=False)
    relative_sd.append(evaluation.promised_sd["alpha_1"].relative_sd)
    print(f"{diameter_mm:.1f} mm: alpha_1 ± {100 * relative_sd[-1]:.2f} %, {evaluation.steps[0].force_n:.3f} N")

best = diameters_mm[relative_sd.index(min(relative_sd))]
print(f"best of these for the exponent: {best} mm")

# %% The program says what cannot be made, and what to change.
try:
    bar.replace(holes=[lk.Hole((0, 0), diameter_mm=13.0)])
except lk.InputError as error:
    print("refused:", error)
else:
    raise AssertionError("a hole wider than the bar is no specimen")
