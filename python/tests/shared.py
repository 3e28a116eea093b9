"""What the tests share."""

import functools
import os
import shutil
import tempfile
import unittest
from pathlib import Path

import lambdak as lk

HERE = Path(__file__).resolve().parent
REPOSITORY = HERE.parents[1]
COARSE = {"voxel_mm": [2.0, 0.6, 2.0], "mm_per_radian": [0.4] * 3, "noise_sd_mm": [0.02] * 3}


def bar(**more):
    """A pulled bar with a hole."""
    fields = {"length_mm": 40, "thickness_mm": 4, "width_mm": 12, "test": "uniaxial", "drive_mm": [4, 8]}
    return lk.Specimen(**{**fields, "holes": [lk.Hole((0, 0), 4)], **more})


def block():
    """The sheared block without holes."""
    return lk.Specimen(
        name="block",
        length_mm=25.4,
        thickness_mm=6.4,
        width_mm=19.1,
        test="double_lap_shear",
        drive_mm=[2.5, 5.0],
        samples_in_parallel=2,
    )


def ecoflex():
    """The material of the synthetic scans."""
    return lk.Material([(17.0, 1.91)], bulk_kpa=2173)


@functools.lru_cache(maxsize=1)
def scanned():
    """A coarse scan of the block; made once."""
    return lk.scan(block(), ecoflex(), seed=3, **COARSE)


def study(**more):
    """A search that takes half a minute."""
    return {
        "schema": "study/1",
        "name": "bar",
        "base": bar(drive_mm=[14]),
        "materials": [{"name": "one term", "material": ecoflex()}],
        "scan": lk.ScanSettings((1.0, 0.5, 0.5), (0.05, 0.05, 0.05), 0.005),
        "vary": {"hole_count": {"min": 0, "max": 2}, "drive_mm": {"min": 4, "max": 14}},
        "limits": {
            "min_ligament_hole_hole_mm": 2,
            "min_ligament_hole_edge_mm": 2,
            "punches_mm": [2, 3, 4, 5, 6],
            "max_drive_mm": 14,
            "max_holes": 2,
        },
        "objective": {"kind": "d_optimal", "combine": "geometric_mean"},
        "budget": {"explore": 30, "confirm": 1},
        "verification": {"is_on": False},
        **more,
    }


class Scratch(unittest.TestCase):
    """A test with a folder of its own."""

    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="lambdak-test-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)


def needs_repository(test):
    """For tests of files that are beside the package in the repository and not in it."""
    return unittest.skipUnless((REPOSITORY / "docs" / "requests.md").is_file(), "the repository is not here")(test)


def environment():
    """The environment of a process that is to find this package where these tests found it."""
    path = os.pathsep.join([str(Path(lk.__file__).parents[1]), str(HERE), os.environ.get("PYTHONPATH", "")])
    return {**os.environ, "PYTHONPATH": path}
