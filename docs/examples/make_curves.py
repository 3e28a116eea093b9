"""Writes curves of homogeneous tests of an incompressible Ogden material, with noise, as a test machine might leave them.

    python3 make_curves.py MATERIAL.json FOLDER

leaves uniaxial.csv, equibiaxial.csv, pure-shear.csv, ratio-3-4.csv and ratio-1-2.csv in FOLDER. Only Python's standard library
is needed.

The nominal stress of a stretch λ along the pull is Σ μᵢ (λ^(αᵢ − 1) − λ^(−m αᵢ − 1)), where the thickness stretches by λ^(−m):
m = ½ in uniaxial, 2 in equibiaxial and 1 in pure shear. In a biaxial test the thickness stretches by 1 / (λ₁λ₂), and the nominal stress
along an axis is Σ μᵢ (λ^αᵢ − (λ₁λ₂)^(−αᵢ)) / λ with λ along it; the numbers in the names are the ratio of the strains.
"""

import json
import random
import sys
from pathlib import Path

terms = [(term["mu_kpa"], term["alpha"]) for term in json.loads(Path(sys.argv[1]).read_text())["terms"]]
folder = Path(sys.argv[2])
folder.mkdir(exist_ok=True)
noise = random.Random(1)

for test, power, largest in [("uniaxial", 0.5, 2.5), ("equibiaxial", 2.0, 1.8), ("pure-shear", 1.0, 2.2)]:
    rows = ["Ecoflex 00-20, made by make_curves.py", "Strain [%];Nominal stress [kPa]"]
    for n in range(1, 61):
        stretch = 1.0 + (largest - 1.0) * n / 60
        stress = sum(mu * (stretch ** (alpha - 1.0) - stretch ** (-power * alpha - 1.0)) for mu, alpha in terms)
        rows.append(f"{100.0 * (stretch - 1.0):.3f};{stress + noise.gauss(0.0, 0.05):.4f}")
    (folder / f"{test}.csv").write_text("\n".join(rows) + "\n")

for name, ratio in [("ratio-3-4", 0.75), ("ratio-1-2", 0.5)]:
    rows = ["Ecoflex 00-20, made by make_curves.py", "Strain X [%];Strain Y [%];P11 [kPa];P22 [kPa]"]
    for n in range(1, 61):
        x, y = 1.0 + 0.8 * n / 60, 1.0 + ratio * 0.8 * n / 60
        along = [sum(mu * (own**alpha - (x * y) ** -alpha) / own for mu, alpha in terms) for own in (x, y)]
        noisy = ";".join(f"{stress + noise.gauss(0.0, 0.05):.4f}" for stress in along)
        rows.append(f"{100.0 * (x - 1.0):.3f};{100.0 * (y - 1.0):.3f};{noisy}")
    (folder / f"{name}.csv").write_text("\n".join(rows) + "\n")
print(f"{folder}: uniaxial.csv, equibiaxial.csv, pure-shear.csv, ratio-3-4.csv, ratio-1-2.csv")
