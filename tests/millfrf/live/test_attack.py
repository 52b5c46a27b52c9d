"""The live page under attack: 200 connections at once, while a recording of 24 channels at 51.2 kHz runs."""

import json
import os
import subprocess
import sys
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from acquisition import Recording

ATTACKER = Path(__file__).with_name("attacker.py")
RATE, N_CHANNELS, CONNECTIONS = 51200, 24, 200
MOST_MEMORY = 120e6
"""Bytes that the attack may cost beyond what the same recording takes with no page open."""

_ENDED = ("huge_frame", "endless_message", "flood", "nonsense")
"""What ends a page, where there was room for one."""


@dataclass
class Attacked:
    """What a recording and its attackers said."""

    answers: dict[str, dict[str, int]]
    before: float
    peak: float
    said: str
    complained: str
    code: int


def _session(seconds: float) -> str:
    lines = [f"duration_s = {seconds}", "band_hz = [5.0, 1000.0]", "[device]", 'driver = "ni"']
    lines += [f"sample_rate_hz = {RATE}", "[live]", "segment_s = 0.5"]
    for k in range(N_CHANNELS):
        lines += [
            "[[channels]]",
            f'name = "<img src=x onerror=alert({k})>"',
            f'terminal = "cDAQ1Mod{1 + k // 4}/ai{k % 4}"',
        ]
        lines += [f'node = "P{k // 3}"', f'direction = "+{"XYZ"[k % 3]}"']
        lines += ['quantity = "force"', 'unit = "N"', "units_per_volt = 1"] if k < 3 else []
        lines += ['quantity = "acceleration"', 'unit = "m/s^2"', "mv_per_unit = 1", "iepe_ma = 2"] if k >= 3 else []
    return "\n".join(lines)


def _memory(process: int) -> float:
    """Resident bytes."""
    pages = Path(f"/proc/{process}/statm").read_text().split()[1]
    return float(pages) * os.sysconf("SC_PAGE_SIZE")


def _attacked(folder: Path, environment: dict[str, str], seconds: float) -> Attacked:
    (folder / "s.toml").write_text(_session(seconds + 4))
    command = [sys.executable, "-m", "millfrf", "acquire", "s.toml", "--out", "a.h5", "--live", "--at-once"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    recording = subprocess.Popen(command, cwd=folder, env=environment, **pipes)  # type: ignore[call-overload]
    try:
        url = next(line.split()[-1] for line in recording.stdout if "live page" in line)
        time.sleep(2.0)
        before, sizes, over = _memory(recording.pid), [0.0], threading.Event()

        def watch() -> None:
            while not over.wait(0.1):
                sizes.append(_memory(recording.pid))

        watcher = threading.Thread(target=watch)
        watcher.start()
        attack = [sys.executable, str(ATTACKER), url, str(seconds), str(CONNECTIONS)]
        done = subprocess.run(attack, capture_output=True, text=True, timeout=seconds + 60)
        over.set()
        watcher.join()
        said, complained = recording.communicate(timeout=60)
    finally:
        recording.kill()
    assert done.returncode == 0, done.stderr
    result = Attacked(json.loads(done.stdout), before, max(sizes), said, complained, recording.returncode)
    print(json.dumps(result.answers), f"{result.before / 1e6:.0f} MB before, {result.peak / 1e6:.0f} MB at most", said)
    return result


def _check(found: Attacked, path: Path, seconds: float) -> None:
    """No sample lost, no attack successful, memory bounded, nothing in the log."""
    assert (found.code, found.complained) == (0, "")
    with Recording(path) as recording:
        assert recording.complete
        assert recording.stream().n_samples == round(RATE * (seconds + 4))
        assert recording.events["mark"].read()[0].size == 0
        ramp = np.concatenate([block[:, 0] for block in recording.stream().blocks()])
    steps = np.unique(np.diff(ramp))
    assert len(steps) == 2  # the device's ramp, and where it turns over: no row missing, none twice
    for attack, refusal in (("foreign_host", 421), ("foreign_origin", 403), ("wrong_token", 404), ("two_hosts", 400)):
        assert found.answers[attack].get(str(refusal), 0) > 0, attack
        assert not {"101", "200"} & set(found.answers[attack]), attack
    assert sum("stayed" in found.answers.get(name, {}) for name in _ENDED) == 0
    assert any("ended" in found.answers.get(name, {}) for name in _ENDED)
    assert found.answers["pages"].get("101", 0) > 0
    assert found.answers["pages"].get("503", 0) > 0
    assert found.peak - found.before < MOST_MEMORY


@pytest.mark.long
def test_an_attack_of_five_seconds_costs_no_sample(tmp_path: Path, with_ni: dict[str, str]) -> None:
    _check(_attacked(tmp_path, with_ni, 5.0), tmp_path / "a.h5", 5.0)


@pytest.mark.slow
def test_an_attack_of_a_minute_costs_no_sample(tmp_path: Path, with_ni: dict[str, str]) -> None:
    _check(_attacked(tmp_path, with_ni, 60.0), tmp_path / "a.h5", 60.0)


@pytest.mark.long
def test_an_attack_on_the_page_to_work_on_costs_no_sample(tmp_path: Path, with_ni: dict[str, str]) -> None:
    """`millfrf app` records in a process of its own; strangers with and without its token attack the page."""
    (tmp_path / "s.toml").write_text(_session(9.0))
    page = subprocess.Popen(
        [sys.executable, "-m", "millfrf", "app", ".", "--no-browser"], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    )
    try:
        url = next(word for word in page.stdout.readline().split() if word.startswith("http"))  # type: ignore[union-attr]
        command = [sys.executable, "-m", "millfrf", "acquire", "s.toml", "--out", "a.h5"]
        recording = subprocess.Popen(command, cwd=tmp_path, env=with_ni, stderr=subprocess.PIPE, text=True)
        attack = [sys.executable, str(ATTACKER), url, "5", str(CONNECTIONS), "ws"]
        before = _memory(page.pid)
        done = subprocess.run(attack, capture_output=True, text=True, timeout=90)
        complained, after = recording.communicate(timeout=60)[1], _memory(page.pid)
    finally:
        page.terminate()
        page.wait(20)
    assert done.returncode == 0, done.stderr
    answers = json.loads(done.stdout)
    print(answers)
    for name in ("foreign_host", "foreign_origin", "wrong_token", "two_hosts"):
        assert answers[name], name
        assert not {"101", "200"} & set(answers[name]), name
    assert recording.returncode == 0, complained
    assert after - before < MOST_MEMORY
    with Recording(tmp_path / "a.h5") as content:
        assert content.complete
        assert content.stream().n_samples == round(RATE * 9.0)
