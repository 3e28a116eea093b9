"""Writes curves of homogeneous tests of an incompressible Ogden material, with noise, as a test machine might leave them.

    python3 make_curves.py MATERIAL.json FOLDER

leaves uniaxial.csv, equibiaxial.csv and pure-shear.csv in FOLDER. Only Python's standard library is needed.

The nominal stress of a stretch λ along the pull is Σ μᵢ (λ^(αᵢ − 1) − λ^(−m αᵢ − 1)), where the thickness stretches by λ^(−m):
m = ½ in uniaxial, 2 in equibiaxial and 1 in pure shear.
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
print(f"{folder}: uniaxial.csv, equibiaxial.csv, pure-shear.csv")
