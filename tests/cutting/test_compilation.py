"""The first compilation of an inner loop on a computer is told; code from the cache is not."""

import os
import subprocess
import sys
from pathlib import Path

SCRIPT = """
from millfrf.core.compilation import compiled
from millfrf.core import notices_to

@compiled
def doubled(x):
    return 2 * x

@compiled
def halved(x):
    return x / 2

with notices_to(print):
    assert (doubled(2.0), halved(2.0)) == (4.0, 1.0)
"""


def test_the_first_run_tells_once_why_it_waits_and_the_second_says_nothing(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    root = str(Path(__file__).resolve().parents[2])
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": root}
    first, second = (
        subprocess.run([sys.executable, str(script)], env=environment, capture_output=True, text=True, check=True)
        for _ in range(2)
    )
    assert first.stdout == "compiling inner loops, once on this computer: up to a minute\n"
    assert second.stdout == ""
