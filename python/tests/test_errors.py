"""What is refused, with which words, and what a missing or broken program is answered with."""

import os
import pickle
import stat
import unittest
from unittest import mock

import numpy as np
from shared import Scratch, bar, study

import lambdak as lk
from lambdak import _program


class Input(Scratch):
    def test_a_specimen_is_refused_in_the_programs_words(self):
        with self.assertRaises(lk.InputError) as caught:
            bar(length_mm=-3)
        self.assertEqual(caught.exception.problems, ("/block/length_mm is -3; it must be from 0.2 to 1000",))
        with self.assertRaisesRegex(lk.InputError, "move the holes apart or make them smaller"):
            bar().replace(holes=[lk.Hole((0, 0), 4), lk.Hole((1, 0), 4)])
        with self.assertRaises(lk.InputError) as caught:
            bar(length_mm="long", test="twist")
        self.assertEqual(len(caught.exception.problems), 2, "all that is wrong is said at once")

    def test_a_material_is_refused_in_the_programs_words(self):
        with self.assertRaisesRegex(lk.InputError, "^/bulk_kpa is -1; it must be above 0"):
            lk.Material([(17.0, 1.91)], bulk_kpa=-1)
        with self.assertRaisesRegex(lk.InputError, "Hill's stability"):
            lk.Material([(17.0, -1.0)], bulk_kpa=2000)

    def test_numbers_that_are_none_are_named(self):
        with self.assertRaisesRegex(lk.InputError, "^/holes/0/diameter_mm is nan"):
            bar(holes=[lk.Hole((0, 0), np.nan)])
        with self.assertRaisesRegex(lk.InputError, "^/drive_mm/1 is inf"):
            lk.solve(bar(), drive_mm=[1, np.inf])

    def test_a_request_is_refused_in_the_programs_words(self):
        for problem, call in (
            ("^/mesh is \"coarse\"", lambda: lk.solve(bar(), mesh="coarse")),
            ("^/drive_mm/0 is 1000000; it must be at most 80", lambda: lk.solve(bar(), drive_mm=1e6)),
            ("'solv' is not solve", lambda: lk.run("solv", {})),
            ("^/specimen is missing", lambda: lk.run("solve", {})),
            ("^/speed must be left out|^/speed is", lambda: lk.run("solve", {"specimen": bar(), "speed": 1})),
            ("^invalid value '-1'", lambda: lk.solve(bar(), threads=-1)),
            ("nowhere/recording.json: No such file", lambda: lk.calibrate("nowhere")),
            ("cannot read .*nowhere.csv", lambda: lk.uniaxial("nowhere.csv")),
            ("time-limit", lambda: lk.design(study(), time_limit_min=-1)),
            ("kept_back names shear", lambda: lk.curves({"uniaxial": {"stretch": [1]}}, kept_back=["shear"])),
            ("lists of one length", lambda: lk.uniaxial({"stretch": [1, 2], "stress": [1]})),
        ):
            with self.subTest(problem), self.assertRaisesRegex(lk.InputError, problem):
                call()

    def test_a_folder_with_other_results_is_not_written_to(self):
        lk.solve(bar(), mesh="search", folder=self.folder)
        with self.assertRaisesRegex(lk.InputError, "holds the results of `lambdak solve`"):
            lk.evaluate(bar(), mesh="search", folder=self.folder)

    def test_a_file_that_cannot_be_written_is_another_error(self):
        (self.folder / "file").write_text("in the way")
        with self.assertRaisesRegex(lk.WriteError, "cannot write"):
            lk.solve(bar(), mesh="search", folder=self.folder / "file" / "results")

    def test_a_worse_result_is_another_error(self):
        small, large = (
            lk.evaluate(bar(holes=[lk.Hole((0, 0), d)]), mesh="search", has_files=False).raw for d in (3.0, 6.0)
        )
        request = {"pairs": [{"name": "bar", "base": large, "current": small}], "across_inputs": True}
        with self.assertRaisesRegex(lk.WorseError, "worse") as caught:
            lk.run("compare", request)
        self.assertEqual(caught.exception.raw["schema"], "comparison/1")
        request["pairs"][0].update(current=large)
        self.assertEqual(lk.run("compare", request).raw["schema"], "comparison/1")

    def test_fields_of_a_newer_program_are_not_dropped(self):
        newer = {**bar().to_dict(), "coating": "gold"}
        with self.assertRaisesRegex(lk.InputError, "coating"):
            lk.Specimen.from_json(newer)
        with self.assertRaisesRegex(lk.InputError, "install a newer one"):
            lk.Specimen._of_program(newer)

    def test_errors_are_values_and_can_be_sent_between_processes(self):
        error = lk.InputError(("one", "two"))
        back = pickle.loads(pickle.dumps(error))
        self.assertEqual((str(back), back.problems), ("one\ntwo", ("one", "two")))
        self.assertIsInstance(error, ValueError)


class Program(Scratch):
    def script(self, text):
        """A program of this name that does something else."""
        path = self.folder / "lambdak"
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(path.stat().st_mode | stat.S_IXUSR)
        return path

    def test_a_missing_program_is_named_with_what_to_do(self):
        with mock.patch.dict(os.environ, {_program.VARIABLE: "", "PATH": str(self.folder)}):
            with mock.patch.object(_program, "_script_folders", return_value=[self.folder]):
                with self.assertRaisesRegex(lk.ProgramMissingError, "pip install.*or set LAMBDAK_PROGRAM"):
                    lk.run("solve", {})
                here = self.script("echo lambdak 9.9.9")
                self.assertEqual((lk.program_path(), lk.program_version()), (here, "9.9.9"))
        (self.folder / "lambdak").write_bytes(b"\x7fELF of another machine")
        with mock.patch.dict(os.environ, {_program.VARIABLE: str(self.folder / "lambdak")}):
            with self.assertRaisesRegex(lk.ProgramMissingError, "cannot be run: Exec format error"):
                lk.run("solve", {})
        with mock.patch.dict(os.environ, {_program.VARIABLE: str(self.folder / "gone")}):
            with self.assertRaisesRegex(lk.ProgramMissingError, "gone.*set it to lambdak's path or unset it"):
                lk.solve(bar())

    def test_the_program_beside_the_interpreter_comes_before_that_on_the_path(self):
        other = self.script("echo lambdak 9.9.9")
        own = self.folder / "own"
        own.mkdir()
        (own / "lambdak").write_bytes(other.read_bytes())
        (own / "lambdak").chmod(0o755)
        with mock.patch.dict(os.environ, {_program.VARIABLE: "", "PATH": str(self.folder)}):
            with mock.patch.object(_program, "_script_folders", return_value=[own]):
                self.assertEqual(lk.program_path(), own / "lambdak")
            with mock.patch.object(_program, "_script_folders", return_value=[self.folder / "none"]):
                self.assertEqual(lk.program_path(), other)

    def test_other_ends_are_typed(self):
        for text, error, words in (
            ("echo 'lambdak: no equilibrium' >&2; exit 3", lk.NoSolutionError, "^no equilibrium$"),
            ("echo 'lambdak: disk full' >&2; exit 4", lk.WriteError, "^disk full$"),
            ("kill -KILL $$", lk.ProgramError, "SIGKILL; there may have been too little memory"),
            ("echo hello", lk.ProgramError, "printed no JSON"),
            ("exit 101", lk.ProgramError, "ended with 101"),
            ("echo 'lambdak: a panic' >&2; exit 101", lk.ProgramError, "a panic"),
            ("echo 'version GLIBC_2.99 not found' >&2; exit 1", lk.ProgramError, "ended with 1: .*GLIBC_2.99"),
        ):
            with mock.patch.dict(os.environ, {_program.VARIABLE: str(self.script(text))}):
                with self.subTest(text), self.assertRaisesRegex(error, words):
                    lk.run("solve", {})

    def test_a_request_without_a_solution_says_so(self):
        # A bar that is pushed together buckles.
        with self.assertRaisesRegex(lk.NoSolutionError, "no equilibrium found beyond .*; reduce the drive"):
            lk.solve(bar(), lk.Material([(17.0, 1.91)], bulk_kpa=2000), drive_mm=-6, mesh="search")



if __name__ == "__main__":
    unittest.main()
