"""Recordings as arrays and as folders, and what the program finds in them."""

import gzip
import json
import unittest

import numpy as np
from shared import COARSE, REPOSITORY, Scratch, block, ecoflex, scanned

import lambdak as lk
from lambdak._nifti import read_image, write_image


def recording_of(measured, displacement_mm=None, **more):
    """The arrays of a recording as a new one."""
    u = measured.displacement_mm if displacement_mm is None else displacement_mm
    fields = {"drive_mm": measured.drive_mm, "force_n": measured.force_n, "force_sd_n": 0.02, **more}
    return lk.Recording(block(), u, measured.mask, affine=measured.affine, **fields)


class RoundTrip(Scratch):
    def test_everything_comes_back(self):
        rng = np.random.default_rng(1)
        u = rng.normal(size=(2, 4, 3, 5, 3)).astype(np.float32)
        mask = rng.random((4, 3, 5)) < 0.7
        affine = np.array([[2, 0, 0, -3], [0, 0.5, 0, -0.5], [0, 0, 1.5, -3], [0, 0, 0, 1.0]])
        recording = lk.Recording(
            block(),
            u,
            mask,
            affine=affine,
            drive_mm=[2.5, 5.0],
            force_n=[1.25, None],
            force_sd_n=0.02,
            window_s=[None, (10.0, 20.5)],
            noise_sd_mm=[0.1, 0.2, 0.3],
            filter="hamming2",
            load=[[0.0, 0.0, 0.1], [1 / 3, 0.5, 1e-7]],
            id="a",
            notes={"who": "laboratory"},
        )
        back = lk.Recording.read(recording.write(self.folder / "r"))
        np.testing.assert_array_equal(back.mask, mask)
        np.testing.assert_array_equal(back.displacement_mm[:, mask], u[:, mask])
        self.assertTrue(np.isnan(back.displacement_mm[:, ~mask]).all())
        np.testing.assert_array_equal(back.affine, affine)
        np.testing.assert_array_equal(back.load, recording.load)
        for name in ("drive_mm", "force_n", "force_sd_n", "window_s", "noise_sd_mm", "filter", "id", "notes"):
            self.assertEqual(getattr(back, name), getattr(recording, name), name)
        self.assertEqual(back.specimen, block())
        self.assertEqual(back.voxel_mm, (2.0, 0.5, 1.5))
        np.testing.assert_array_equal(back.positions_mm[1], [-0.5, 0.0, 0.5])

    def test_images_are_those_of_the_program_to_the_byte(self):
        for name in ("u_1.nii.gz", "u_2.nii.gz", "mask.nii.gz"):
            theirs = scanned().folder / name
            image = read_image(theirs)
            write_image(self.folder / name, image.values, image.affine)
            ours = gzip.decompress((self.folder / name).read_bytes())
            self.assertEqual(ours, gzip.decompress(theirs.read_bytes()), name)

    def test_a_scan_is_read_as_its_summary_says(self):
        recording = scanned().recording
        self.assertEqual(recording.displacement_mm.shape, (2, 19, 17, 16, 3))
        self.assertEqual(int(recording.mask.sum()), scanned().raw["num_voxels"])
        self.assertEqual(recording.force_n, tuple(step.force_n for step in scanned().steps))
        # The plate at +y moves by the drive along x; x is component 0, y index 1.
        y = recording.positions_mm[1]
        columns = np.where(recording.mask, recording.displacement_mm[1, ..., 0], np.nan)
        layers = [layer[np.isfinite(layer)] for layer in columns.swapaxes(0, 1)]
        profile = [(place, layer.mean()) for place, layer in zip(y, layers) if len(layer) > 0]
        slope = np.polyfit(*zip(*profile), 1)[0]
        self.assertAlmostEqual(slope, 5.0 / 6.4, delta=0.03)

    def test_arrays_are_the_recordings_own(self):
        u = np.zeros((1, 2, 2, 2, 3))
        recording = lk.Recording(block(), u, drive_mm=2.5, voxel_mm=[1, 1, 1], origin_mm=[0, 0, 0])
        u[:] = 7.0
        self.assertEqual(float(recording.displacement_mm.max()), 0.0)
        with self.assertRaises(ValueError):
            recording.displacement_mm[:] = 1.0
        self.assertTrue(recording.mask.all())
        with self.assertRaisesRegex(AttributeError, "make a new one"):
            recording.drive_mm = (5.0,)

    def test_masked_arrays_and_partly_filled_voxels(self):
        hidden = np.zeros((2, 2, 2, 3), bool)
        hidden[0, 1, 1] = True
        u = np.ma.MaskedArray(np.full((2, 2, 2, 3), 9), mask=hidden)
        place = {"drive_mm": 2.5, "voxel_mm": [1, 1, 1], "origin_mm": [0, 0, 0]}
        recording = lk.Recording(block(), u, **place)
        self.assertEqual(np.argwhere(~recording.mask).tolist(), [[0, 1, 1]])
        self.assertTrue(np.isnan(recording.displacement_mm[0, 0, 1, 1]).all())
        several = lk.Recording(block(), [u, u], **{**place, "drive_mm": [1, 2]})
        self.assertTrue(np.isnan(several.displacement_mm[1, 0, 1, 1]).all())
        self.assertEqual(float(several.displacement_mm[1, 0, 0, 0, 0]), 9.0)
        parts = np.full((2, 2, 2), 0.5)
        parts[1, 1, 1] = 0.49
        recording = lk.Recording(block(), u, parts, **place)
        self.assertEqual(np.argwhere(~recording.mask).tolist(), [[1, 1, 1]])

    def test_the_middle_of_the_masks_box_is_the_origin(self):
        mask = np.zeros((7, 5, 4), bool)
        mask[2:5, 1:3, 0:4] = True
        self.assertEqual(lk.centered_origin(mask, [2.0, 1.0, 0.5]), (-6.0, -1.5, -0.75))
        with self.assertRaisesRegex(lk.InputError, "empty"):
            lk.centered_origin(np.zeros((2, 2, 2)), [1, 1, 1])

    def test_arrays_that_do_not_belong_together_are_refused(self):
        u, place = np.zeros((2, 3, 3, 3, 3)), {"voxel_mm": [1, 1, 1], "origin_mm": [0, 0, 0]}
        for problem, more in (
            ("drive_mm holds 1 drives and displacement_mm 2", {"drive_mm": 5.0}),
            ("mask has the shape", {"drive_mm": [1, 2], "mask": np.ones((3, 3, 2))}),
            ("force_n holds 1 numbers; give one for each of 2", {"drive_mm": [1, 2], "force_n": 3.0}),
            ("window_s holds 1", {"drive_mm": [1, 2], "window_s": [(0, 1)]}),
            ("said in one way", {"drive_mm": [1, 2], "affine": np.eye(4)}),
            ("said in one way", {"drive_mm": [1, 2], "origin_mm": None}),
        ):
            with self.subTest(problem), self.assertRaisesRegex(lk.InputError, problem):
                lk.Recording(block(), u, **{**place, **more})
        with self.assertRaisesRegex(lk.InputError, r"\(drives, nx, ny, nz, 3\) is needed"):
            lk.Recording(block(), np.zeros((3, 4, 5)), drive_mm=1.0, **place)

    def test_damaged_folders_are_refused_by_name(self):
        recording = recording_of(scanned().recording)
        with self.assertRaisesRegex(lk.InputError, "recording.json: No such file"):
            lk.Recording.read(self.folder)
        recording.write(self.folder)
        image = self.folder / "u_2.nii.gz"
        image.write_bytes(image.read_bytes()[:500])
        with self.assertRaisesRegex(lk.InputError, "u_2.nii.gz"):
            lk.Recording.read(self.folder)
        image.write_bytes(b"not an image, but long enough for its header" * 10)
        with self.assertRaisesRegex(lk.InputError, "not a NIfTI-1 image"):
            lk.Recording.read(self.folder)
        recording.write(self.folder)
        (self.folder / "recording.json").rename(self.folder / "other.json")
        self.assertEqual(lk.Recording.read(self.folder / "other.json").drive_mm, recording.drive_mm)
        (self.folder / "recording.json").write_text(json.dumps({"schema": "mru-recording/1"}))
        with self.assertRaisesRegex(lk.InputError, "no mru-recording/1"):
            lk.Recording.read(self.folder)

    def test_other_kinds_of_images_are_read(self):
        data = REPOSITORY / "tests" / "data" / "import"
        if not data.is_dir():
            self.skipTest("the repository is not here")
        for name in ("float32_qform.nii.gz", "float64_big.nii", "int16_scaled.nii.gz", "uint8.nii.gz"):
            image = read_image(data / name)
            self.assertTrue(np.isfinite(image.values).all(), name)
            self.assertGreater(abs(np.linalg.det(image.affine)), 0.0, name)


class FromArrays(Scratch):
    def test_calibration_finds_the_material_within_its_intervals(self):
        calibration = lk.calibrate(recording_of(scanned().recording), num_terms=1, mesh_factor=1.8, num_starts=1)
        truth = {"mu_1": 17.0, "alpha_1": 1.91}
        for name, value in truth.items():
            estimate = calibration.parameters[name]
            self.assertLess(estimate.interval_95[0], value, estimate)
            self.assertGreater(estimate.interval_95[1], value, estimate)
            # An interval that holds everything would hold the truth, too.
            self.assertLess(estimate.interval_95[1] - estimate.interval_95[0], 0.2 * value, estimate)
            self.assertTrue(estimate.identifiable)
        self.assertAlmostEqual(calibration.material.terms[0].mu_kpa, calibration.parameters["mu_1"].value)
        self.assertLess(calibration.initial_shear_modulus.interval_95[0], 0.5 * 17.0 * 1.91)
        self.assertAlmostEqual(calibration.chi2_per_datum, 1.0, delta=0.3)
        self.assertTrue(calibration.report.is_file())
        self.assertEqual([step.drive_mm for step in calibration.steps], [2.5, 5.0])
        self.assertEqual(lk.Material.from_json(calibration.folder / "material.json"), calibration.material)

    def test_several_recordings_are_calibrated_together(self):
        first = recording_of(scanned().recording, id="first")
        second = lk.scan(block(), ecoflex(), seed=4, drive_mm=4, name="second", **COARSE).folder
        both = lk.calibrate(
            [first, second], num_terms=1, mesh_factor=2, num_starts=1, has_mesh_allowance=False, folder=self.folder
        )
        self.assertEqual({step.recording for step in both.steps}, {"first", "second-seed-4"})
        self.assertEqual(len(both.recordings), 2)

    def test_arrays_in_the_wrong_unit_sign_or_order_are_refused_with_the_reason(self):
        measured = scanned().recording
        u = measured.displacement_mm
        for reason, wrong in (("metres", u / 1000), ("sign", -u), ("component", u[..., [1, 0, 2]])):
            with self.subTest(reason), self.assertRaisesRegex(lk.InputError, reason):
                lk.calibrate(recording_of(measured, wrong), num_terms=1, mesh_factor=3)
        mirrored = measured.affine.copy()
        mirrored[0, 0] *= -1
        with self.assertRaisesRegex(lk.InputError, "mirrors"):
            lk.calibrate(lk.Recording(block(), u, measured.mask, affine=mirrored, drive_mm=measured.drive_mm))

    def test_raw_phases_are_imported(self):
        raw = lk.scan(block(), ecoflex(), seed=3, is_raw=True, drive_mm=2.5, **COARSE)
        with self.assertRaisesRegex(lk.InputError, "import_recording"):
            raw.recording
        recording = lk.import_recording(raw.folder)
        self.assertEqual(int(np.isfinite(recording.displacement_mm[0, ..., 0]).sum()), raw.raw["num_voxels"])

    def test_points_are_imported(self):
        measured = scanned().recording
        inside = np.argwhere(measured.mask)
        place = inside * measured.voxel_mm + measured.affine[:3, 3]
        table = np.hstack([place, measured.displacement_mm[0][measured.mask]])
        np.savetxt(self.folder / "p.csv", table, delimiter=",", header="x,y,z,ux,uy,uz", comments="")
        recording = lk.import_recording(
            self.folder / "p.csv", block(), form="points", drive_mm=2.5, voxel_mm=measured.voxel_mm
        )
        np.testing.assert_allclose(
            np.sort(recording.displacement_mm[0][recording.mask][:, 0]), np.sort(table[:, 3]), atol=1e-5
        )


if __name__ == "__main__":
    unittest.main()
