"""`python -m lambdak …` is `lambdak …`, for shells whose PATH does not hold this environment's programs."""

import os
import subprocess
import sys

from ._program import program_path

if __name__ == "__main__":
    program = str(program_path())
    if sys.platform == "win32":
        # There the shell would not wait for a program that takes Python's place.
        sys.exit(subprocess.call([program, *sys.argv[1:]]))
    os.execv(program, [program, *sys.argv[1:]])
