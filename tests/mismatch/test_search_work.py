"""The work of a search is counted in computed values: neither a clock nor other processes change the answer."""

import ast
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from hidden_joint import law_of, moved_by, with_law
from one_mode_rig import Rig

import millfrf.mismatch
from millfrf.command_line import FAILED, run
from millfrf.mismatch import SearchSettings, Settings, diagnose, fit, in_processes, library, write_diagnosis
from millfrf.mismatch.inference.work import WorkLimit, count_work, counted_work
from millfrf.mismatch.structure import diagnosing

CLOCKS = {"time", "datetime", "timeit", "sched"}


@pytest.mark.long
def test_a_search_without_work_tells_what_it_has() -> None:
    """One round is made in any case: the law of that round is proved as usual."""
    rig = Rig(response="displacement").stiffened(0.3, 60.0)
    recordings = rig.recordings((20.0, 40.0, 60.0))
    stages: list[str] = []
    hurried = diagnose(rig.model, recordings, Settings(search=SearchSettings(most_work=0.0)), stages.append)
    assert [each.name for each in hurried.physics] == ["stiffness_hardening"]
    assert hurried.improvement.after < 0.1 * hurried.improvement.before
    assert "causes, round 1" in stages
    assert "causes, round 2" not in stages
    assert "causes of implausible modes" not in stages
    assert any("million values" in doubt and "--search-work" in doubt for doubt in hurried.doubts)


def test_a_search_within_its_work_says_nothing_of_it() -> None:
    rig = Rig(response="displacement")
    diagnosis = diagnose(rig.model, rig.recordings((20.0, 40.0), 15.0))
    assert np.isfinite(diagnosis.improvement.after)
    assert not any("--search-work" in doubt for doubt in diagnosis.doubts)


def test_no_clock_is_read_by_a_diagnosis() -> None:
    """A verdict that depends on the load of the machine is no verdict."""
    for path in sorted(Path(millfrf.mismatch.__file__).parent.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            names += [node.module or ""] if isinstance(node, ast.ImportFrom) and not node.level else []
            assert not CLOCKS & {name.partition(".")[0] for name in names}, path


@contextmanager
def _busy_processes(count: int) -> Iterator[None]:
    """Keep the cores busy."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


@pytest.mark.long
def test_a_busy_machine_and_more_processes_give_the_same_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The limit ends the search after the first round, where a clock would decide by the load of the machine."""
    rig = Rig(response="displacement").stiffened(0.3, 60.0)
    recordings = rig.recordings((20.0, 40.0, 60.0), 12.0)
    names = ("stiffness_hardening", "coulomb_friction", "gain_error", "missing_mode")
    causes = {name: cause for name, cause in library().items() if name in names}
    settings = Settings(causes=causes, search=SearchSettings(most_work=0.05))

    def file(cores: int) -> str:
        monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(cores)))
        diagnosis = diagnose(rig.model, recordings, settings)
        assert [cause.name for cause in diagnosis.physics] == ["stiffness_hardening"]
        assert any("--search-work" in doubt for doubt in diagnosis.doubts)
        write_diagnosis(tmp_path / "diagnosis.json", diagnosis)
        return (tmp_path / "diagnosis.json").read_text(encoding="utf-8")

    idle = file(1)
    with _busy_processes(2):
        assert [file(1), file(2)] == [idle, idle]


def _counting(values: int) -> int:
    count_work(values)
    return values


@pytest.mark.parametrize("cores", [1, 2, 3])
def test_work_in_other_processes_is_counted(monkeypatch: pytest.MonkeyPatch, cores: int) -> None:
    """Also that of a task which fails in a process and is run again."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: set(range(cores)))
    with counted_work() as outer:
        with counted_work() as work:
            in_processes([partial(_counting, 10**k) for k in range(6)])
        count_work(7)
    assert work.values == 111_111
    assert outer.values == 111_118
    assert WorkLimit(0.111111, work).reached
    assert not WorkLimit(0.111112, work).reached


def test_values_of_a_fit_are_samples_of_signals_and_lines_of_derivatives() -> None:
    """Without steps a fit computes one simulation and one Jacobian of each recording; a joint adds its own samples."""
    friction = law_of("coulomb_friction")
    with_joint = with_law(friction, np.array([1.0, 2e-3]))
    lines = moved_by(with_joint, (20.0, 40.0))
    for hypothesis, joints in ((replace(with_joint, causes=()), 0), (with_joint, 1)):
        with counted_work() as work:
            fit(lines, hypothesis, iterations=0)
        simulated = sum(each.padded * (1 + joints) for each in lines)
        derived = sum(len(each.frequencies) + each.padded * joints for each in lines)
        assert work.values == simulated + hypothesis.size * derived


def _interrupts_its_parent() -> None:
    """Again after a second: an interrupt while a process is forked is ignored by Python."""
    while True:
        time.sleep(1.0)
        os.kill(os.getppid(), signal.SIGINT)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="tasks run in this process")
def test_an_interrupted_diagnosis_has_no_verdict(
    rig_files: tuple[Path, list[Path]],
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Ctrl-C while processes search: one line, no file, and no process that goes on."""
    model, recordings = rig_files
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1})
    monkeypatch.setattr(
        diagnosing, "search_with_laws_together", lambda *_: in_processes([_interrupts_its_parent, signal.pause])
    )
    # a shell that starts the tests in the background has Ctrl-C ignored
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        code = run(["diagnose", str(model), *map(str, recordings), "--out", str(tmp_path / "out")])
    finally:
        signal.signal(signal.SIGINT, before)
    assert code == FAILED
    assert capfd.readouterr().err == "millfrf: not finished, no verdict: stopped; nothing was written\n"
    assert list(tmp_path.iterdir()) == []
    assert multiprocessing.active_children() == []
