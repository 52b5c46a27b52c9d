"""Processes end with the one that made them, however it is killed."""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process of its parent's death")

COPIES = """
import os, sys, time
from pathlib import Path
os.sched_getaffinity = lambda process: {0, 1}
from millfrf.mismatch import in_processes
def sleeps(name):
    Path(sys.argv[1], name).write_text(str(os.getpid()))
    time.sleep(600)
in_processes([lambda: sleeps("a"), lambda: sleeps("b")])
"""

POOL = """
import os, sys, time
from pathlib import Path
from millfrf.core import process_pool
def sleeps(name):
    Path(sys.argv[1], name).write_text(str(os.getpid()))
    time.sleep(600)
with process_pool(2) as pool:
    list(pool.map(sleeps, ["a", "b"]))
"""


def _is_there(process: int) -> bool:
    """Whether a process runs; one that has ended and that nobody asked after does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


def _wait_for(happened: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize("program", [COPIES, POOL], ids=["copies", "pool"])
def test_children_end_with_a_process_that_is_killed(program: str, tmp_path: Path) -> None:
    killed = subprocess.Popen([sys.executable, "-c", program, str(tmp_path)])
    files = [tmp_path / "a", tmp_path / "b"]
    _wait_for(lambda: all(each.exists() and each.read_text() for each in files))
    children = [int(each.read_text()) for each in files]
    assert all(map(_is_there, children))
    killed.kill()
    killed.wait()
    _wait_for(lambda: not any(map(_is_there, children)))
