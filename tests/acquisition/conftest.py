"""A simulated NI device: the DAQmx library's entry points built with gcc and found through the loader's path."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

SOURCE = Path(__file__).with_name("simulated_daqmx.c")
RunWithDaqmx = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture(scope="session")
def daqmx_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with the simulated libnidaqmx; put it first in LD_LIBRARY_PATH of a new process."""
    if shutil.which("gcc") is None or not sys.platform.startswith("linux"):
        pytest.skip("the simulated DAQmx library needs gcc on Linux")
    pytest.importorskip("nidaqmx")
    folder = tmp_path_factory.mktemp("daqmx")
    library = folder / "libnidaqmx.so.1"
    flags = ["-O2", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC", f"-Wl,-soname,{library.name}"]
    subprocess.run(["gcc", *flags, "-o", str(library), str(SOURCE), "-lm"], check=True)
    (folder / "libnidaqmx.so").symlink_to(library.name)
    return folder


@pytest.fixture
def with_daqmx(daqmx_folder: Path, tmp_path: Path) -> RunWithDaqmx:
    """Run a Python program (text, or arguments after `-m`) where the simulated device is installed."""

    def run(program: str | list[str], **settings: object) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, **{name: str(value) for name, value in settings.items()}}
        environment["LD_LIBRARY_PATH"] = str(daqmx_folder)
        command = ["-c", program] if isinstance(program, str) else ["-m", *program]
        return subprocess.run(
            [sys.executable, *command], env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=60
        )

    return run
