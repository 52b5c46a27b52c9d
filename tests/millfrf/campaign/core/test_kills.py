"""A worker or a whole run is killed by the system, without a word: what is resumed gives the same bytes."""

import hashlib
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import psutil
import pytest

PROGRAM = [sys.executable, "-m", "millfrf"]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[4])}


def contents(out: Path) -> dict[str, str]:
    """Hash of every file of results and summary."""
    files = [path for part in ("results", "summary") for path in (out / part).rglob("*") if path.is_file()]
    return {path.relative_to(out).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def started(campaign: Path, out: Path, *words: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*PROGRAM, "campaign", str(campaign), "--out", str(out), *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=ENVIRONMENT,
    )


def resumed(campaign: Path, out: Path, *words: str) -> str:
    """Run the same command again to its end; what it said."""
    run = started(campaign, out, *words)
    said, fault = run.communicate(timeout=300)
    assert run.returncode == 0, fault
    return said


def finished(out: Path) -> int:
    """Number of tasks with an outcome."""
    return len(list(out.glob("results/*/*/*/outcome.json")))


def wait_for_results(out: Path, number: int, run: subprocess.Popen[str]) -> None:
    end = time.monotonic() + 120
    while finished(out) < number:
        assert run.poll() is None, run.communicate()
        assert time.monotonic() < end
        time.sleep(0.02)


def workers_of(run: subprocess.Popen[str]) -> list[psutil.Process]:
    """Processes below the run that compute: those whose command line is that of a spawned process."""
    try:
        below = psutil.Process(run.pid).children(recursive=True)
        return [each for each in below if "spawn_main" in " ".join(each.cmdline())]
    except psutil.Error:  # one of them ended meanwhile
        return []


@pytest.fixture(scope="module")
def undisturbed(maker: Callable[[Path], Path], tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("undisturbed")
    run = started(maker(folder / "campaign"), folder / "out", "--workers", "0")
    assert run.wait(timeout=120) == 0, run.communicate()
    return contents(folder / "out")


@pytest.mark.long
def test_a_run_that_was_killed_is_resumed_with_the_same_bytes(
    maker: Callable[[Path], Path], undisturbed: dict[str, str], tmp_path: Path
) -> None:
    campaign, out = maker(tmp_path / "elsewhere"), tmp_path / "results of it"
    killed = started(campaign, out, "--workers", "0")
    wait_for_results(out, 12, killed)
    killed.send_signal(signal.SIGKILL)
    killed.wait()
    there = finished(out)
    said = resumed(campaign, out, "--workers", "0")
    assert f"{len([each for each in undisturbed if each.endswith('outcome.json')]) - there} tasks run now" in said
    assert contents(out) == undisturbed


@pytest.mark.slow
def test_workers_and_then_the_run_are_killed(
    maker: Callable[[Path], Path], undisturbed: dict[str, str], tmp_path: Path
) -> None:
    campaign, out = maker(tmp_path / "campaign"), tmp_path / "out"
    run = started(campaign, out, "--workers", "2")
    wait_for_results(out, 6, run)
    workers_of(run)[0].send_signal(signal.SIGKILL)
    wait_for_results(out, 15, run)
    below = psutil.Process(run.pid).children(recursive=True)
    run.send_signal(signal.SIGKILL)
    run.wait()
    assert not psutil.wait_procs(below, timeout=20)[1]
    assert "0 left for the next run" in resumed(campaign, out, "--workers", "2")
    assert contents(out) == undisturbed


@pytest.mark.slow
def test_tasks_whose_workers_always_die_are_left_for_the_next_run(
    maker: Callable[[Path], Path], undisturbed: dict[str, str], tmp_path: Path
) -> None:
    campaign, out = maker(tmp_path / "campaign"), tmp_path / "out"
    run = started(campaign, out, "--workers", "2")
    wait_for_results(out, 3, run)
    end = time.monotonic() + 300
    while run.poll() is None and time.monotonic() < end:
        for each in workers_of(run):
            with suppress(psutil.Error):
                if time.time() - each.create_time() > 3:
                    each.kill()
        time.sleep(0.5)
    said, fault = run.communicate(timeout=10)
    assert run.returncode == 1, (said, fault)
    assert "its worker died four times while it ran" in said
    assert "unforeseen" not in said + fault
    resumed(campaign, out, "--workers", "2")
    assert contents(out) == undisturbed


@pytest.mark.slow
def test_a_scheduler_that_dies_ends_the_run_in_one_line_and_another_takes_over(
    maker: Callable[[Path], Path], undisturbed: dict[str, str], tmp_path: Path
) -> None:
    campaign, out = maker(tmp_path / "campaign"), tmp_path / "out"
    with cluster(tmp_path, 2) as (address, scheduler):
        run = started(campaign, out, "--scheduler", address)
        wait_for_results(out, 8, run)
        scheduler.kill()
        fault = run.communicate(timeout=120)[1]
    lines = [line for line in fault.splitlines() if " tasks, " not in line]
    assert run.returncode == 1
    assert lines == [
        "millfrf: the scheduler is gone; results so far are kept: start it, and run the same command again"
    ]
    with cluster(tmp_path, 2) as (address, scheduler):
        assert "0 left for the next run" in resumed(campaign, out, "--scheduler", address)
    assert contents(out) == undisturbed


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[tuple[str, subprocess.Popen[bytes]]]:
    """A scheduler and workers as a lab starts them, by Dask's own commands."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    words = [
        ["scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard"],
        *[
            ["worker", address, "--nthreads", "1", "--no-dashboard", "--memory-limit", "0", "--local-directory", folder]
            for _ in range(workers)
        ],
    ]
    quiet = subprocess.DEVNULL
    processes = [
        subprocess.Popen([sys.executable, "-m", "dask", *each], stdout=quiet, stderr=quiet, env=ENVIRONMENT, cwd=folder)
        for each in words
    ]
    try:
        yield address, processes[0]
    finally:
        for each in processes:
            each.terminate()
        for each in processes:
            each.wait(timeout=60)
