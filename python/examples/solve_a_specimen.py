"""Forces and the deformed shape of a pulled bar with a hole."""

# %% A specimen and a material
import lambdak as lk

bar = lk.Specimen(
    length_mm=40,
    thickness_mm=4,
    width_mm=12,
    test="uniaxial",
    drive_mm=[4, 8, 14],
    holes=[lk.Hole((0, 0), diameter_mm=4)],
)
ecoflex = lk.Material([(17.0, 1.91)], bulk_kpa=2173)

# %% Solve it. In a notebook, `solution` alone shows the table and the picture.
solution = lk.solve(bar, ecoflex, on_progress=print)
for step in solution.steps:
    print(f"{step.drive_mm:5.1f} mm  {step.force_n:.3f} N  largest stretch {step.largest_principal_stretch:.2f}")
print("picture:", solution.pictures[0])

assert solution.steps[-1].force_n > solution.steps[0].force_n
