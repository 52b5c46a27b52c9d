"""Inputs of the writing commands, the modules of this folder, and a process that runs command lines in trials."""

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

for _name in ("writing_commands", "whole_files"):
    _spec = importlib.util.spec_from_file_location(_name, Path(__file__).with_name(f"{_name}.py"))
    assert _spec is not None
    assert _spec.loader is not None
    _module = importlib.util.module_from_spec(_spec)
    sys.modules[_name] = _module
    _spec.loader.exec_module(_module)

Trial = Callable[..., dict[str, Any]]


@pytest.fixture(scope="session")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with everything that the writing commands read; tests copy it."""
    folder = tmp_path_factory.mktemp("inputs")
    sys.modules["writing_commands"].make_inputs(folder)
    return folder


@pytest.fixture(scope="session")
def failing_disk(tmp_path_factory: pytest.TempPathFactory) -> Path | None:
    """The library that lets a disk fail, compiled; None where that is not possible."""
    if shutil.which("gcc") is None or not sys.platform.startswith("linux"):
        return None
    library = tmp_path_factory.mktemp("failing_disk") / "failing_disk.so"
    flags = ["-O1", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, "-o", library, Path(__file__).with_name("failing_disk.c"), "-ldl"], check=True)
    return library


@pytest.fixture(scope="session")
def trial(failing_disk: Path | None) -> Iterator[Trial]:
    """Run a command line in a process of its own: ``trial(folder, words, kill_after=..., largest_file=...)``."""
    if not hasattr(os, "fork"):
        pytest.skip("copies of a process are made as Linux does")
    command = [sys.executable, str(Path(__file__).with_name("trial_runner.py"))]
    at_once = os.environ | {"EAGER_IMPORT": "1"}  # of lazy_loader: the copies need not load anything again
    if failing_disk is not None:
        at_once["LD_PRELOAD"] = str(failing_disk)
    server = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=at_once)
    assert server.stdin is not None
    assert server.stdout is not None
    pipes = server.stdin, server.stdout

    def run_it(folder: Path, words: list[str], **asked: object) -> dict[str, Any]:
        pipes[0].write(json.dumps({"folder": str(folder), "words": words, **asked}) + "\n")
        pipes[0].flush()
        answer: dict[str, Any] = json.loads(pipes[1].readline())
        return answer

    yield run_it
    pipes[0].close()
    server.wait()
