"""The traditional route: Ogden terms from the curves of homogeneous tests."""

# %% A curve as arrays: stretch and nominal stress of an Ogden solid with μ = 17 kPa and α = 1.91
import numpy as np

import lambdak as lk

mu, alpha = 17.0, 1.91
stretch = np.linspace(1.0, 2.0, 21)
noise = 0.01 * np.random.default_rng(1).standard_normal(len(stretch))
uniaxial = {
    "stretch": stretch,
    "nominal_stress_kpa": mu * (stretch ** (alpha - 1) - stretch ** (-0.5 * alpha - 1)) + noise,
}
pure_shear = {"stretch": stretch, "nominal_stress_kpa": mu * (stretch ** (alpha - 1) - stretch ** (-alpha - 1)) + noise}

# %% One test alone. A path to a CSV file of a test machine serves as well.
fit = lk.uniaxial(uniaxial)
for estimate in fit.parameters.values():
    print(f"{estimate.name}: {estimate.value:.4g} ± {estimate.sd:.2g}")
low, high = fit.parameters["mu_1"].interval_95
assert low < mu < high

# %% Several tests together, with one kept back and predicted
joint = lk.curves({"uniaxial": uniaxial, "pure_shear": pure_shear}, kept_back=["pure_shear"])
print("relative error of the test kept back:", joint.raw["kept_back"][0]["relative_rms_error"])
assert joint.raw["kept_back"][0]["relative_rms_error"] < 0.01
