"""The examples and the code of the documentation run, and the types hold."""

import contextlib
import importlib.util
import io
import os
import re
import subprocess
import sys
import unittest
from pathlib import Path

from shared import HERE, REPOSITORY, Scratch, environment, needs_repository

import lambdak as lk

EXAMPLES = sorted((HERE.parent / "examples").glob("*.py"))


class Examples(Scratch):
    def test_every_example_runs(self):
        self.assertGreaterEqual(len(EXAMPLES), 7)
        for example in EXAMPLES:
            with self.subTest(example.name):
                ended = subprocess.run(
                    [sys.executable, "-W", "error", str(example)],
                    cwd=self.folder,
                    env=environment(),
                    capture_output=True,
                    text=True,
                    timeout=600,
                    check=False,
                )
                self.assertEqual(ended.returncode, 0, ended.stderr)
                self.assertTrue(ended.stdout)

    def test_temporary_folders_are_deleted_when_python_ends(self):
        code = "import lambdak as lk; from shared import bar; print(lk.solve(bar(), mesh='search').folder)"
        said = subprocess.run(
            [sys.executable, "-c", code], env=environment(), capture_output=True, text=True, check=True
        )
        self.assertIn("lambdak-solve-", said.stdout)
        self.assertFalse(Path(said.stdout.strip()).exists())


class Documents(Scratch):
    @needs_repository
    def test_the_code_of_the_documentation_runs(self):
        here = os.getcwd()
        self.addCleanup(os.chdir, here)
        for document in (REPOSITORY / "docs" / "python.md", HERE.parent / "README.md"):
            os.chdir(self.folder)
            pieces = re.findall(r"^```python\n(.*?)^```", document.read_text(encoding="utf-8"), re.S | re.M)
            self.assertTrue(pieces, document)
            names = {}
            for number, piece in enumerate(pieces, start=1):
                with self.subTest(f"{document.name}, piece {number}"), contextlib.redirect_stdout(io.StringIO()):
                    exec(compile(piece, f"{document.name} {number}", "exec"), names)

    @needs_repository
    def test_the_table_names_every_function(self):
        text = (REPOSITORY / "docs" / "python.md").read_text(encoding="utf-8")
        functions = [name for name in lk.__all__ if callable(getattr(lk, name)) and name.islower()]
        self.assertEqual([name for name in functions if f"`{name}(" not in text], [])


@unittest.skipUnless(importlib.util.find_spec("mypy"), "mypy is not installed")
class Types(unittest.TestCase):
    def check(self, *arguments):
        # mypy finds installed packages itself, and refuses to be told where they are.
        place = Path(lk.__file__).parents[1]
        path = {} if place.name == "site-packages" else {"MYPYPATH": str(place)}
        ended = subprocess.run(
            [sys.executable, "-m", "mypy", "--strict", "--cache-dir", os.devnull, *arguments],
            env={**os.environ, **path},
            capture_output=True,
            text=True,
            check=False,
        )
        self.assertEqual(ended.returncode, 0, ended.stdout + ended.stderr)

    def test_types_hold(self):
        self.assertTrue((Path(lk.__file__).parent / "py.typed").is_file())
        self.check("-p", "lambdak")

    def test_examples_use_what_is_typed(self):
        self.check(*map(str, EXAMPLES))


if __name__ == "__main__":
    unittest.main()
