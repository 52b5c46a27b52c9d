"""Kernels are compiled once on a computer, with a line that says so, and where nothing can be written in memory."""

import os
import re
import subprocess
import sys
from pathlib import Path

from millfrf.core.compilation import CUTTING, KERNELS

ROOT = Path(__file__).resolve().parents[2]
WARM_UP = """
from millfrf.core.compilation import CUTTING, cache_folder, compile_kernels
from millfrf.core.terminal import speaking

with speaking():
    compile_kernels(*CUTTING)
print(cache_folder())
"""
LOBES = """
from pathlib import Path
import numpy as np
from millfrf.core.compilation import CUTTING, STABILITY, cache_folder, compile_kernels
from millfrf.cutting import MillingProcess
from millfrf.stability import collocation
from replay_data import default_structure, tip_model

compile_kernels(*CUTTING, *STABILITY)
before = set(cache_folder().rglob("*.nbc"))
cut = MillingProcess(2, 0.0127, np.pi / 2, 1e8, 0.17, 0.33, 0.0, np.pi, 1e-4)
collocation(tip_model(default_structure()), cut, np.linspace(10.0, 40.0, 7), 0.01)
print([file.name for file in set(cache_folder().rglob("*.nbc")) - before])
"""


def run(script: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a script in a process of its own, with some environment variables set."""
    return subprocess.run(
        [sys.executable, "-c", script],
        env=os.environ | environment,
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )


def test_the_first_run_says_why_it_waits_and_the_second_says_nothing(tmp_path: Path) -> None:
    first, second = (run(WARM_UP, XDG_CACHE_HOME=str(tmp_path)) for _ in range(2))
    assert first.stderr.startswith("note: compiling inner loops, once on this computer: up to a minute\n")
    assert second.stderr == ""
    assert len([*tmp_path.rglob("*.nbc")]) >= len(CUTTING)


def test_without_a_writable_folder_kernels_are_compiled_in_memory(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()  # no folder can be made below a file, whoever runs the test
    result = run(WARM_UP, XDG_CACHE_HOME=str(file))
    assert result.stdout == "None\n"
    assert result.stderr.startswith("note: compiling inner loops, in each run")
    assert result.stderr.count("compiling") == 1


def test_the_list_of_kernels_is_complete() -> None:
    rooms = ("acquisition", "estimation", "modal_fit", "replay_data", "millfrf")
    sources = [file for room in rooms for file in (ROOT / room).rglob("*.py")]
    marks = re.compile(r"^@(compiled|inner_loop|product_loop)", re.MULTILINE)  # stored code is of these sources
    compiled = {file for file in sources if marks.search(file.read_text(encoding="utf-8"))}
    assert compiled == {ROOT / f"{module.replace('.', '/')}.py" for module in KERNELS}


def test_lobes_compile_nothing_that_the_warm_up_has_not_compiled() -> None:
    assert run(LOBES).stdout == "[]\n"
