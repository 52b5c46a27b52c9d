"""The first Ctrl-C ends every command within 2 s in one line, wherever it is, and leaves nothing unfinished."""

import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

COMMANDS = (
    "convert up.h5 out.csv",
    "estimate up.h5 down.h5 central.h5 --segment 4 --out out.h5",
    "fit up.h5 down.h5 central.h5 --band 13 30 --out out.json",
    "lobes model_tip.json --cutting cut.toml --speeds 600 1200 200 --max-depth 0.01 --out out.csv",
    "diagnose model_tip.json steady.h5 --out out",
    "report frf_tip.h5 model_tip.json --out out.html",
)


@pytest.mark.slow  # its deadline holds on a machine without other load
@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
@pytest.mark.parametrize("delay", [0.2, 1.0, 3.0])
@pytest.mark.parametrize("command", COMMANDS)
def test_the_first_ctrl_c_ends_a_command(command: str, delay: float, inputs: Path, tmp_path: Path) -> None:
    folder = tmp_path / "work"
    shutil.copytree(inputs, folder)
    before = set(folder.iterdir())
    process = subprocess.Popen(
        [sys.executable, "-m", "millfrf", *command.split()],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        process.wait(delay)
    except subprocess.TimeoutExpired:
        pass
    else:
        pytest.skip("this computer had done it before")
    sent = time.monotonic()
    process.send_signal(signal.SIGINT)
    printed, complained = process.communicate(timeout=30)
    if process.returncode == 0 or "wrote " in printed:  # it was just done, and Python was closing down
        return
    assert time.monotonic() - sent < 2.0
    # Python passes the signal on if it came while the text of a class was compiled
    assert process.returncode in (1, -signal.SIGINT)
    lines = complained.splitlines()
    if delay > 0.5:  # before, the interpreter itself may be loading
        assert lines[-1].startswith("millfrf: stopped; ")
        assert "Traceback" not in complained
    assert set(folder.iterdir()) == before
