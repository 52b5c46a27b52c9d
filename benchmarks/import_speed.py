"""Time that an import takes, of the processor alone: `python -m benchmarks.import_speed`.

Each import runs in a new interpreter, seven times; the smallest time counts, beside that of `import numpy` and of an
interpreter that imports nothing, which is taken off. A name is lazy in its room's front, so `mismatch.diagnose` shows
what its first use loads. What takes longer than promised gets a mark, and the exit code is 1.
"""

import os
import subprocess
import sys

REPEATS = 7
CASES = (
    ("import numpy", None),
    ("import millfrf", 0.15),
    ("import millfrf.__main__", None),
    ("import estimation", None),
    ("import mismatch", 1.0),
    ("import matplotlib.figure", None),
    ("import mismatch; mismatch.diagnose", None),
    ("import millfrf as mf; mf.diagnose", None),
)
"""Statements with the time that each is promised to take at most, s."""

_PROGRAM = "import time; {statement}; print(time.process_time())"


def seconds(statement: str) -> float:
    """Least processor time of an interpreter that runs a statement and ends, s."""
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-c", _PROGRAM.format(statement=statement)]
    times = [
        float(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)
        for _ in range(REPEATS)
    ]
    return min(times)


def main() -> int:
    """Print a line for each statement; returns 1 where a promise is broken."""
    nothing = seconds("pass")
    result = {statement: seconds(statement) - nothing for statement, _ in CASES}
    for statement, promised in CASES:
        stated = "" if promised is None else f"  promised {promised:.2f} s{'  MISSED' * (result[statement] > promised)}"
        ratio = result[statement] / result[CASES[0][0]]
        print(f"{statement:<38}{result[statement]:7.3f} s {ratio:6.1f} times numpy{stated}")
    return int(any(promised is not None and result[statement] > promised for statement, promised in CASES))


if __name__ == "__main__":
    sys.exit(main())
