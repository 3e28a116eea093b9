"""`python -m lambdak …` is `lambdak …`, for shells whose PATH does not hold this environment's programs."""

import os
import sys

from ._program import program_path

if __name__ == "__main__":
    program = str(program_path())
    os.execv(program, [program, *sys.argv[1:]])
