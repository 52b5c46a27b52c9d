"""Sample rates: a file that states another one than it was sampled at moves every mode."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.signal import resample_poly

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core.provenance import read_provenance

BAND = ["--band", "13", "25"]


def stating(source: Path, target: Path, rate: float) -> Path:
    """A copy of a recording that states another sample rate."""
    shutil.copy(source, target)
    with h5py.File(target, "r+") as file:
        next(iter(file["signals"].values())).attrs["sample_rate"] = rate
        file.attrs["format_version"] = 2  # as another program writes it: without a copy of the texts
    return target


def resampled(source: Path, target: Path, up: int, down: int, stated: float) -> Path:
    """A copy at up/down times the rate, which states what it is told."""
    stating(source, target, stated)
    with h5py.File(target, "r+") as file:
        group = next(iter(file["signals"].values()))
        samples = resample_poly(np.asarray(group["samples"][:], dtype=float), up, down, axis=0)
        del group["samples"]
        group["samples"] = samples
        file.attrs["format_version"] = 1  # as another program writes it: without checksums
    return target


def others(sweeps: dict[str, Path]) -> list[str]:
    return [str(sweeps["central"]), str(sweeps["down"])]


def test_a_file_that_states_half_the_rate_is_not_fitted_with_the_others(
    sweeps: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = stating(sweeps["up"], tmp_path / "up.h5", 512.0)
    assert run(["fit", *others(sweeps), str(wrong), *BAND, "--out", str(tmp_path / "m.json")]) == BAD_INPUT
    said = capsys.readouterr().err
    assert "up.h5 states 512 Hz, central.h5 1024 Hz" in said
    assert "agree only when the frequencies of up.h5 are multiplied by 2" in said


def test_two_true_rates_are_reconciled_by_their_spectra(
    sweeps: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    right = resampled(sweeps["up"], tmp_path / "up.h5", 1, 2, stated=512.0)
    code = run(["fit", *others(sweeps), str(right), *BAND, "--out", str(tmp_path / "m.json")])
    assert code == DONE, capsys.readouterr().err
    assert "warning" not in capsys.readouterr().err


@pytest.mark.parametrize(("up", "down"), [(2, 1), (1, 2), (2, 5)])
def test_one_stated_rate_for_two_true_ones_is_doubted(
    sweeps: dict[str, Path], tmp_path: Path, up: int, down: int, capsys: pytest.CaptureFixture[str]
) -> None:
    """The up-milling sweep came at up/down times the rate that it states, and that the others have."""
    out = tmp_path / "frf.h5"
    wrong = resampled(sweeps["up"], tmp_path / "up.h5", up, down, stated=1024.0)
    code = run(["estimate", *others(sweeps), str(wrong), "--segment", "4", "--out", str(out)])
    said = capsys.readouterr().err
    assert code == DONE, said
    assert "warning: up.h5: its spectra agree with those of central.h5 only when its frequencies are multiplied" in said
    assert any("its spectra agree" in text for text in read_provenance(out)["warnings"])


def test_tests_of_one_set_up_agree(sweeps: dict[str, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["estimate", *map(str, sweeps.values()), *BAND, "--out", str(tmp_path / "f.h5")]) == DONE
    assert "warning" not in capsys.readouterr().err
