"""Results: typed fields, tables, grids, pictures; and that the functions take what the program takes."""

import copy
import dataclasses
import importlib.util
import inspect
import json
import math
import re
import unittest
from unittest import mock

import numpy as np
from shared import COARSE, REPOSITORY, Scratch, bar, block, ecoflex, needs_repository, scanned, study

import lambdak as lk

HAS_TABLES = all(importlib.util.find_spec(package) for package in ("pandas", "xarray"))
needs_tables = unittest.skipUnless(HAS_TABLES, "pandas and xarray are not installed")


class Parts(Scratch):
    def test_laws_in_the_first_invariant(self):
        for material in (
            lk.Material.neo_hookean(16.0, bulk_kpa=2000),
            lk.Material.mooney_rivlin(6.0, 2.0, bulk_kpa=2000),
            lk.Material.yeoh((8.0, -0.2, 0.04), bulk_kpa=2000),
            lk.Material.gent(16.0, 30.0, bulk_kpa=2000),
            lk.Material.arruda_boyce(15.0, 2.5, bulk_kpa=2000),
        ):
            self.assertEqual(lk.Material.from_json(material.to_json()), material)
        with self.assertRaises(lk.InputError):
            lk.Material.gent(16.0, 0.0, bulk_kpa=2000)

    def test_specimens_and_materials_come_back_from_json(self):
        thicker = lk.Sample(12, 5, 9, holes=[lk.Hole((0, 0), 2)])
        bent = bar(holes=[lk.Hole((1.5, 0.25), 2.0, axis="width")], outline="block")
        slot = lk.Hole((1.5, 0.25), 2.0, shape=lk.HoleShape("slot", 4.0, angle_deg=30))
        slotted = bar(holes=[slot], outline="block")
        notched = bar(holes=[lk.Hole((0, s * 6.0), 3.0, is_notch=True) for s in (-1, 1)], outline="block")
        necked = bar(holes=[], outline=lk.Dumbbell(6, 8, 5))
        for part in (bar(), block(), bent, slotted, notched, necked, block().replace(other_samples=[thicker])):
            self.assertEqual(type(part).from_json(part.to_json()), part)
            part.to_json(self.folder / "part.json")
            self.assertEqual(type(part).from_json(self.folder / "part.json"), part)
        material = lk.Material([(17.0, 1.91), lk.Term(0.5, 6.0)], bulk_kpa=2173)
        self.assertEqual(lk.Material.from_json(material.to_json()), material)
        self.assertEqual(material.terms[1], lk.Term(0.5, 6.0))

    @needs_repository
    def test_the_shipped_files_are_read(self):
        for file in sorted((REPOSITORY / "geometries").glob("*.json")):
            self.assertTrue(lk.Specimen.from_json(file).drive_mm, file)
        for file in sorted((REPOSITORY / "geometries" / "materials").glob("*.json")):
            self.assertTrue(lk.Material.from_json(file).terms, file)

    def test_numpys_numbers_are_numbers(self):
        of_numpy = bar(length_mm=np.float64(40), drive_mm=np.array([4, 8]), holes=[lk.Hole(np.zeros(2), np.int64(4))])
        self.assertEqual(of_numpy, bar())

    def test_values_stay_as_they_are(self):
        specimen = bar()
        with self.assertRaises(dataclasses.FrozenInstanceError):
            specimen.length_mm = 3
        longer = specimen.replace(length_mm=50)
        self.assertEqual((specimen.length_mm, longer.length_mm, longer.holes), (40, 50, specimen.holes))
        self.assertEqual(copy.deepcopy(specimen), specimen)
        self.assertEqual(hash(specimen), hash(bar()))


class Results(Scratch):
    def test_a_solution(self):
        solution = lk.solve(bar(), ecoflex(), mesh="search", folder=self.folder)
        self.assertEqual([step.drive_mm for step in solution.steps], [4.0, 8.0])
        self.assertEqual(solution.steps[1].force_n, solution.raw["steps"][1]["force_n"])
        self.assertEqual(solution.raw["schema"], "solve/1")
        self.assertEqual(solution.pictures, [self.folder / "deformed.svg"])
        self.assertIsNone(solution.report)
        self.assertTrue((self.folder / "solution.pvd").is_file())
        page = solution._repr_html_()
        self.assertIn("<td>8</td>", page)
        self.assertEqual(page.count("data:image/svg+xml"), 1)
        with self.assertRaises(dataclasses.FrozenInstanceError):
            solution.steps = ()

    def test_drives_and_options_reach_the_program(self):
        solution = lk.solve(bar(), ecoflex(), drive_mm=3, mesh=2.0, fields="last", is_whole=True)
        self.assertEqual([step.drive_mm for step in solution.steps], [3.0])
        self.assertEqual(solution.raw["mirror"], [False, False])
        request = {"specimen": bar(), "material": ecoflex(), "drive_mm": np.array([3.0]), "mesh": 2.0, "is_whole": True}
        same = lk.run("solve", request).raw["steps"][0]["force_n"]
        self.assertAlmostEqual(same, solution.steps[0].force_n, places=12)

    def test_an_evaluation(self):
        scanner = lk.ScanSettings((1.0, 0.5, 0.5), (0.05, 0.05, 0.05), 0.005, partial_voxels="signal")
        one = lk.evaluate(bar(), ecoflex(), scan=scanner, mesh="search")
        self.assertEqual(one.raw["scan"]["partial_voxels"], "signal")
        self.assertEqual(set(one.promised_sd), {"kappa", "mu_1", "alpha_1"})
        self.assertEqual(set(one.steps[0].integrated_sensitivity), {"mu_1", "alpha_1"})
        self.assertGreater(one.steps[0].promised_sd["mu_1"].value, one.promised_sd["mu_1"].value)
        np.testing.assert_allclose(np.diag(one.correlation), 1.0)
        self.assertGreaterEqual(len(one.pictures), 6)
        numbers = lk.evaluate(bar(), ecoflex(), scan=scanner, mesh="search", has_files=False)
        self.assertEqual(numbers.pictures, [])
        self.assertEqual(numbers.promised_sd, one.promised_sd)
        self.assertEqual(one.detectable, ())
        found = lk.evaluate(bar(), ecoflex(), scan=scanner, mesh="search", has_detectable=True, has_files=False)
        sizes = {d.parameter: d for d in found.detectable if d.cause in ("gain", "hole")}
        self.assertTrue(0 < sizes["relative_gain_error_x"].size < 0.5)
        self.assertEqual(sizes["diameter_error_mm"].description[:6], "hole 0")
        self.assertIn(sizes["diameter_error_mm"].limited_by, ("noise", "allowance", "rival"))

    def test_an_encoded_scan(self):
        scanner = lk.ScanSettings((1.0, 0.5, 0.5), (0.05, 0.05, 0.05), 0.005, mm_per_radian=(0.5, 0.5, 0.5))
        one = lk.evaluate(bar(), ecoflex(), scan=scanner, mesh="search", has_files=False)
        loss = one.steps[-1].phase_loss
        self.assertTrue(0 <= loss.num_voxels_lost < one.steps[-1].num_voxels)
        # Pulled along x, the bar's displacement changes most along x.
        self.assertTrue(loss.mean_signal[0] < loss.mean_signal[1] <= 1 and loss.mean_signal[0] < loss.mean_signal[2])
        even = lk.evaluate(bar(), ecoflex(), scan=dataclasses.replace(scanner, mm_per_radian=None), mesh="search")
        self.assertIsNone(even.steps[-1].phase_loss)
        self.assertGreater(one.promised_sd["alpha_1"].value, even.promised_sd["alpha_1"].value)

    def test_a_diagnosis_of_two(self):
        first, second = (lk.scan(block(), ecoflex(), seed=seed, name=f"s{seed}", **COARSE).folder for seed in (5, 6))
        both = lk.diagnose_together([first, lk.Recording.read(second)], mesh_factor=2.5, max_causes=1)
        self.assertEqual([one.verdict for one in both.diagnoses], ["no_mismatch", "no_mismatch"])
        self.assertTrue(both.agrees)
        low, high = both.parameters["mu_1"].interval_95
        self.assertTrue(low < both.material.terms[0].mu_kpa < high)
        self.assertEqual(both.report.name, "together.html")
        self.assertEqual(both.diagnoses[1].report.name, "2-report.html")
        self.assertTrue(all(path.name.startswith("2-") for path in both.diagnoses[1].pictures))
        if HAS_TABLES:
            self.assertEqual(both.diagnoses[1].to_xarray()["residual_after"].shape, (2, 19, 17, 16, 3))

    @needs_repository
    def test_the_next_scan(self):
        block = lk.Specimen(
            length_mm=12, thickness_mm=4, width_mm=9, test="double_lap_shear", drive_mm=[2], samples_in_parallel=2
        )
        made = lk.scan(block, ecoflex(), voxel_mm=[1, 0.5, 1], mesh=2.0, seed=1).recording
        study = REPOSITORY / "geometries" / "studies" / "two-hole-shear.json"
        answer = lk.next_scan(made, study, num_terms=1, mesh_factor=4, num_drives=1, precision=0.5)
        self.assertEqual(answer.verdict, "reached")
        self.assertEqual(set(answer.relative_sd), {"mu_1", "alpha_1"})
        # The study's base, and the block again, which needs no change of the specimen.
        self.assertEqual(len(answer.candidates), 2)
        again = next(c for c in answer.candidates if c.is_repeat)
        self.assertEqual((again.drive_mm, again.minutes), ((2.0,), 12))
        for candidate in answer.candidates:
            for name, sd in candidate.promised_relative_sd.items():
                self.assertLess(sd, answer.relative_sd[name])

    def test_a_study_names_files_beside_it(self):
        (self.folder / "study").mkdir()
        bar(drive_mm=[14]).to_json(self.folder / "bar.json")
        ecoflex().to_json(self.folder / "study" / "soft.json")
        named = {**study(), "base": "../bar.json", "materials": [{"name": "one", "material": "soft.json"}]}
        named["scan"] = named["scan"].to_dict()
        (self.folder / "study" / "study.json").write_text(json.dumps(named))

        class Begun(Exception):
            pass

        def on_progress(text):
            raise Begun(text)

        with self.assertRaises(Begun):
            lk.design(self.folder / "study" / "study.json", folder=self.folder / "d", on_progress=on_progress)
        with self.assertRaisesRegex(lk.InputError, "soft.json"):
            (self.folder / "study" / "soft.json").unlink()
            lk.design(self.folder / "study" / "study.json", folder=self.folder / "d", on_progress=on_progress)

    def test_a_material_for_other_programs(self):
        export = lk.export_material(ecoflex(), formats=["abaqus", "febio"], stress_unit="kpa", name="soft")
        self.assertEqual(set(export.cards), {"abaqus", "febio"})
        self.assertIn("*HYPERELASTIC, OGDEN", export.cards["abaqus"].text)
        self.assertAlmostEqual(export.cards["abaqus"].constants["mu_1"], 0.5 * 17.0 * 1.91)

    def test_a_curve_file_in_another_code_than_utf_8(self):
        rows = "".join(f"{1 + 0.1 * n:.1f};{5.0 * n ** 0.8:.3f}\n".replace(".", ",") for n in range(11))
        (self.folder / "zug.csv").write_bytes(f"Prüfung bei 23 °C\nDehnung;Spannung [kPa]\n{rows}".encode("cp1252"))
        with self.assertRaises(lk.InputError):
            lk.uniaxial({"distance": [1, 2, 3], "stress_kpa": [1, 2, 3]})
        fit = lk.uniaxial(self.folder / "zug.csv", drive_column="Dehnung", max_terms=1)
        self.assertEqual(fit.num_terms, 1)
        self.assertFalse(fit.is_bulk_held)
        self.assertGreater(fit.initial_shear_modulus.interval_95[1], fit.initial_shear_modulus.value)
        text = (self.folder / "zug.csv").read_bytes().decode("cp1252")
        (self.folder / "zug.csv").write_bytes(text.encode("utf-16"))
        again = lk.uniaxial(self.folder / "zug.csv", drive_column="Dehnung", max_terms=1)
        self.assertEqual(again.initial_shear_modulus, fit.initial_shear_modulus)

    def test_curves_of_a_law(self):
        stretch = [1 + 0.05 * n for n in range(1, 31)]
        # Gent's law, 16 kPa and 6, but for a little waviness.
        first = [s * s + 2 / s - 3 for s in stretch]
        stress = [
            16 * 6 / (6 - x) * (s - s**-2) * (1 + 1e-3 * math.sin(7.3 * n * n))
            for n, (s, x) in enumerate(zip(stretch, first))
        ]
        fit = lk.uniaxial({"stretch": stretch, "nominal_stress_kpa": stress}, law="gent", folder=self.folder / "fit")
        self.assertEqual((fit.law, fit.num_terms), ("gent", 0))
        # The waviness is 0.07 % rms.
        self.assertAlmostEqual(fit.parameters["j_m"].value, 6.0, delta=0.03)
        self.assertEqual(next(iter(fit.bic_above_best)), "Gent")
        cards = lk.export_material(fit.material, folder=self.folder / "cards").cards
        self.assertEqual(set(cards), {"ansys", "comsol", "febio"})

    def test_biaxial_curves(self):
        # Incompressible, one term of 20 kPa and 2.2, three ratios of the strains, but for a little waviness.
        def stress(own, other, n):
            return 20 * (own**1.2 - (own * other) ** -2.2 / own) * (1 + 1e-3 * math.sin(7.3 * n * n))

        def test(ratio):
            first = [1 + 0.02 * n for n in range(1, 31)]
            second = [1 + ratio * (s - 1) for s in first]
            pairs = list(zip(first, second))
            return {
                "stretch_x": first,
                "stretch_y": second,
                "P_x_kPa": [stress(a, b, n) for n, (a, b) in enumerate(pairs)],
                "P_y_kPa": [stress(b, a, n + 40) for n, (a, b) in enumerate(pairs)],
            }

        fit = lk.curves({"biaxial": [test(ratio) for ratio in (1.0, 0.75, 0.5)]}, max_terms=2)
        self.assertEqual(fit.num_terms, 1)
        for name, truth in [("mu_1", 20.0), ("alpha_1", 2.2)]:
            self.assertAlmostEqual(fit.parameters[name].value, truth, delta=0.005 * truth)
        # Columns by number; the stress along the second axis alone.
        names = dict(zip(("a", "b", "c", "d"), test(0.5).values()))
        names["c"] = [float("nan")] * 30
        with self.assertRaisesRegex(lk.InputError, "no column for the stretch"):
            lk.curves({"biaxial": names})
        columns = {"drive_column": 1, "second_drive_column": "b", "stress_column": "c", "second_stress_column": 4}
        one = lk.curves({"biaxial": names}, stress_unit="kpa", max_terms=1, **columns)
        self.assertAlmostEqual(one.parameters["mu_1"].value, 20.0, delta=0.2)

    def test_signs_are_asked_for(self):
        stretch = [1 - 0.02 * n for n in range(1, 20)]
        down = {"stretch": stretch, "stress_kpa": [-14 * (s - s**-2) for s in stretch]}
        with self.assertRaisesRegex(lk.InputError, "turn the sign"):
            lk.uniaxial(down)
        fit = lk.uniaxial(down, turned="stress", max_terms=1)
        self.assertAlmostEqual(fit.initial_shear_modulus.value, 14.0, delta=0.01)

    def test_what_the_program_does_not_know_is_nan(self):
        from lambdak._results import _estimates

        (one,) = _estimates([{"name": "mu_2", "value": None, "sd": None, "interval_95": [None, 3.0]}]).values()
        self.assertTrue(math.isnan(one.value) and math.isnan(one.sd) and math.isnan(one.interval_95[0]))
        self.assertEqual(one.interval_95[1], 3.0)


class Tables(Scratch):
    @needs_tables
    def test_tables(self):
        solution = lk.solve(bar(), ecoflex(), mesh="search").to_pandas()
        self.assertEqual(list(solution["drive_mm"]), [4.0, 8.0])
        evaluation = lk.evaluate(bar(), ecoflex(), mesh="search", has_files=False).to_pandas()
        self.assertEqual(len(evaluation), 6)
        self.assertEqual(evaluation.query("parameter == 'kappa'")["integrated_sensitivity"].isna().sum(), 2)
        vary = [{"pointer": "/specimen/holes/0/diameter_mm", "values": [3.0, 4.0]}]
        base = {"specimen": bar(), "mesh": "search", "has_files": False}
        sweep = lk.run("evaluate-list", {"name": "diameters", "base": base, "vary": vary}).to_pandas()
        self.assertEqual(sorted(set(sweep["/specimen/holes/0/diameter_mm"])), [3.0, 4.0])
        with self.assertRaisesRegex(lk.InputError, "its numbers are in raw"):
            lk.run("solve", {"specimen": bar(), "mesh": "search"}).to_pandas()
        recording = scanned().recording
        points = recording.to_pandas()
        self.assertEqual(len(points), 2 * int(recording.mask.sum()))
        row = points.iloc[-1]
        index = tuple(np.argwhere(recording.mask)[-1])
        self.assertEqual(row["ux_mm"], recording.displacement_mm[(1, *index, 0)])
        self.assertEqual(row["z_mm"], recording.positions_mm[2][index[2]])

    @needs_tables
    def test_grids(self):
        recording = scanned().recording
        grid = recording.to_xarray()
        self.assertEqual(grid["displacement"].dims, ("drive_mm", "x", "y", "z", "component"))
        middle = grid["displacement"].sel(drive_mm=5.0, component="x").sel(x=0, y=0, z=1, method="nearest")
        self.assertAlmostEqual(float(middle), 2.5, delta=0.1)
        fit = lk.calibrate(recording, num_terms=1, mesh_factor=2, num_starts=1, has_mesh_allowance=False)
        images = fit.to_xarray()
        np.testing.assert_allclose(
            images["misfit"], images["measured"] - images["model"], atol=1e-6, err_msg="misfit = measured − model"
        )
        self.assertEqual(list(fit.to_pandas()["parameter"]), ["kappa", "mu_1", "alpha_1"])

    def test_a_missing_package_is_named(self):
        with mock.patch.dict("sys.modules", {"pandas": None, "xarray": None}):
            with self.assertRaisesRegex(lk.MissingPackageError, "pip install pandas"):
                scanned().recording.to_pandas()
            with self.assertRaisesRegex(ImportError, "pip install xarray"):
                scanned().recording.to_xarray()


class Requests(unittest.TestCase):
    """Every field of a request is an argument of its function."""

    KINDS = {
        "solve": (lk.solve,),
        "evaluate": (lk.evaluate,),
        "scan": (lk.scan,),
        "import": (lk.import_recording,),
        "calibrate": (lk.calibrate,),
        "diagnose": (lk.diagnose, lk.diagnose_together),
        "next": (lk.next_scan,),
        "curves": (lk.curves,),
        "uniaxial": (lk.uniaxial,),
        "export-material": (lk.export_material,),
    }
    OTHER_NAMES = {"csv": "curve", "curves": "tests", "recording": "recording"}

    @needs_repository
    def test_functions_take_what_requests_hold(self):
        text = (REPOSITORY / "docs" / "requests.md").read_text(encoding="utf-8")
        for kind, functions in self.KINDS.items():
            section = re.search(rf"^## {kind}\n(.*?)(?=^## |\Z)", text, re.S | re.M)[1]
            fields = re.findall(r"^\| `([a-z_0-9.]+)` ", section, re.M)
            self.assertGreater(len(fields), 2, kind)
            taken = {name for function in functions for name in inspect.signature(function).parameters}
            # A recording to import is named among the files; raw phases would be no Recording.
            taken |= {"recording", "is_raw"} if kind == "import" else set()
            for name in fields:
                top, _, below = name.partition(".")
                # `fit` and `columns` of curves are arguments of their own.
                spread = {"fit": "", "columns": "", "second_axis": "second_"}
                if bool(below) != (top in spread):
                    continue
                asked = spread[top] + below if below else self.OTHER_NAMES.get(top, top)
                self.assertIn(asked, taken, f"{kind}: {name}")

    def test_every_function_takes_the_common_arguments(self):
        for functions in (*self.KINDS.values(), (lk.run, lk.design)):
            for function in functions:
                names = inspect.signature(function).parameters
                self.assertLessEqual({"folder", "threads", "on_progress"}, set(names), function.__name__)


if __name__ == "__main__":
    unittest.main()
