"""Signals that are dead, clipped, copied, lost or absurd: refused in one line, or doubted in the stored result."""

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core.provenance import read_provenance
from millfrf.gate import check_recordings
from millfrf.gate.signal_faults import RepeatedRows

Samples = np.ndarray
CHANNELS = {"fx": 0, "fy": 1, "fz": 2, "ax": 3, "ay": 4, "az": 5}


def changed(source: Path, target: Path, change: Callable[[Samples], Samples]) -> Path:
    """A copy of a recording with other samples, as 64-bit numbers, and without a full scale of any channel."""
    shutil.copy(source, target)
    with h5py.File(target, "r+") as file:
        group = next(iter(file["signals"].values()))
        samples = change(np.asarray(group["samples"][:], dtype=float))
        del group["samples"]
        group["samples"] = samples
        file.attrs["format_version"] = 1  # as another program writes it: without checksums
        channels = json.loads(group.attrs["channels"])
        group.attrs["channels"] = json.dumps([{k: v for k, v in c.items() if k != "full_scale"} for c in channels])
    return target


def column(name: str, change: Callable[[Samples], Samples]) -> Callable[[Samples], Samples]:
    """A change of one channel."""

    def of_all(samples: Samples) -> Samples:
        samples[:, CHANNELS[name]] = change(samples[:, CHANNELS[name]])
        return samples

    return of_all


def clipped(samples: Samples) -> Samples:
    limit = np.quantile(np.abs(samples), 0.97)
    return np.clip(samples, -limit, limit)


def copied(samples: Samples) -> Samples:
    samples[:, CHANNELS["ay"]] = samples[:, CHANNELS["ax"]]
    return samples


def doubled(samples: Samples) -> Samples:
    samples[4000:4400] = samples[3600:4000]
    return samples


def held(samples: Samples) -> Samples:
    samples[4000:4400] = samples[4000]
    return samples


REFUSED = {
    "dead response": (column("ay", lambda x: 0 * x), "channel ay is dead (every sample is 0)"),
    "flat response": (column("ay", lambda x: 0 * x + 3.5), "channel ay is dead (every sample is 3.5)"),
    "dead force": (column("fz", lambda x: 0 * x), "channel fz is dead"),
    "no force at all": (lambda x: x * [0, 0, 0, 1, 1, 1], "is dead (every sample is 0)"),
    "absurd force": (column("fx", lambda x: x * 1e300), "more than 1e+07 N"),
    "absurd forces": (lambda x: x * [1e300, 1e300, 1e300, 1, 1, 1], "check its unit and sensitivity"),
    "missing samples": (column("ax", lambda x: np.where(np.arange(len(x)) == 77, np.nan, x)), "NaN or infinite"),
    "one cable in two inputs": (copied, "channel ay holds the same samples as ax"),
}
DOUBTED = {
    "clipped": (column("ax", clipped), "pile up at"),
    "stored twice": (doubled, "a buffer was stored twice"),
    "held": (held, "buffers were lost"),
    "proportional": (lambda x: x[:, [0, 1, 2, 3, 3, 5]] * [1, 1, 1, 1, -0.7, 1], "ay is ax times a fixed number"),
}


@pytest.mark.parametrize("verb", ["estimate", "fit"])
@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_in_one_line(
    sweeps: dict[str, Path], name: str, verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, message = REFUSED[name]
    files = [str(changed(path, tmp_path / path.name, change)) for path in sweeps.values()]
    out = tmp_path / {"estimate": "frf.h5", "fit": "model.json"}[verb]
    assert run([verb, *files, "--band", "13", "25", "--out", str(out)]) == BAD_INPUT
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
    assert not out.exists()


@pytest.mark.parametrize("name", DOUBTED)
def test_it_is_doubted_on_the_terminal_and_in_the_file(
    sweeps: dict[str, Path], name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, message = DOUBTED[name]
    changes = {"central": change}
    files = [str(changed(path, tmp_path / path.name, changes.get(key, lambda x: x))) for key, path in sweeps.items()]
    assert run(["estimate", *files, "--band", "13", "25", "--out", str(tmp_path / "frf.h5")]) == DONE
    said = capsys.readouterr().err
    assert "warning: central.h5: " in said
    assert message in said
    assert any(message in warning for warning in read_provenance(tmp_path / "frf.h5")["warnings"])


@pytest.mark.parametrize("name", DOUBTED)
def test_inspect_says_it_too(
    sweeps: dict[str, Path], name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, message = DOUBTED[name]
    assert run(["inspect", str(changed(sweeps["central"], tmp_path / "c.h5", change))]) == DONE
    said = " ".join(capsys.readouterr().out.split())
    assert message in said
    assert "nothing looks wrong" not in said


def test_a_force_that_rests_in_one_of_several_tests_is_no_fault(sweeps: dict[str, Path], tmp_path: Path) -> None:
    resting = changed(sweeps["up"], tmp_path / "up.h5", column("fz", lambda x: 0 * x))
    assert check_recordings([resting, sweeps["down"]]) == []


def test_signals_that_only_look_clipped_are_not_doubted(sweeps: dict[str, Path], tmp_path: Path) -> None:
    """Coarse steps, a tooth out of the cut that gives exactly zero, and a commanded square wave."""
    time = np.arange(24 * 1024) / 1024

    def odd(samples: Samples) -> Samples:
        samples[:, 3] = np.round(5.2 * np.sin(2 * np.pi * 7.3 * time[: len(samples)]))
        samples[:, 0] = np.maximum(samples[:, 0], 0.0)
        samples[:, 1] = np.sign(np.sin(2 * np.pi * 3 * time[: len(samples)]) + 0.3)
        return samples

    assert check_recordings([changed(sweeps["up"], tmp_path / "odd.h5", odd)]) == []


def test_sound_recordings_are_not_doubted(sweeps: dict[str, Path]) -> None:
    assert check_recordings(list(sweeps.values())) == []


@pytest.mark.parametrize("lost", [False, True])
def test_a_converter_at_rest_is_no_lost_buffer(lost: bool) -> None:
    """Sound that begins with 971 zeros and swells, rounded to whole numbers; then a buffer is held in its loud part."""
    noise = np.random.default_rng(5).standard_normal((8000, 2))
    rows = np.concatenate([np.zeros((971, 2)), np.rint(np.linspace(0, 300, 8000)[:, None] * noise)])
    if lost:
        rows[6000:6400] = rows[6000]
    repeats = RepeatedRows()
    repeats.add(rows)
    assert repeats.n_held == pytest.approx(399 if lost else 0, abs=1)
