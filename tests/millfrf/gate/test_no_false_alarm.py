"""The gate is silent on measurements that are sound: other laboratories', and the practice cases."""

import gzip
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition import convert
from estimation import Frf
from millfrf.core import InputError
from millfrf.gate import check_frf, check_model, check_recordings
from millfrf.steps.estimate import estimate
from modal_fit import read_modal_model

MAPPING = Path(__file__).resolve().parents[3] / "examples" / "fsm_mapping.toml"
pytestmark = pytest.mark.shared_data


def fsm(shared_data: Path, folder: Path, level: int) -> list[Path]:
    return list(convert(shared_data / "fsm-cubespec-mimo" / f"u_{level}mV_train.npy", folder / "rec.h5", MAPPING))


def plane(shared_data: Path) -> Frf:
    """74 hammer points and three accelerometers; a line counts where the hit is coherent at one of them."""
    stored = np.load(shared_data / "plane-hammer" / "plane.npz")
    frequencies, values = stored["frequency_hz"], stored["accelerance"].transpose(2, 1, 0)
    places = tuple(f"P{k + 1}:+{'Z' if k < 68 else 'X'}" for k in range(74))
    names = ("A1:+Z", "A2:+Z", "A3:+Z")
    return Frf(frequencies, values, names, places, "accelerance", "m/s^2/N", frequencies > 0)


def beam(shared_data: Path) -> Frf:
    """Nine hammer points and one accelerometer, as text of an analyser."""
    columns = []
    for number in range(1, 10):
        path = shared_data / "modelab-beam" / f"Hxysv{number:05d}.txt.gz"
        with gzip.open(path, "rt", encoding="latin-1") as file:
            columns.append(np.array([[float(x) for x in line.split()[:3]] for line in list(file)[9:] if line.strip()]))
    table = np.array(columns)
    values = (table[:, :, 1] + 1j * table[:, :, 2]).T[:, None, :]
    places = tuple(f"P{k}:+X" for k in range(1, 10))
    return Frf(table[0, :, 0], values, ("A:+X",), places, "accelerance", "m/s^2/N", table[0, :, 0] > 0)


@pytest.mark.parametrize("level", [100, 300])
def test_the_mirror_rig(shared_data: Path, tmp_path: Path, level: int) -> None:
    paths = fsm(shared_data, tmp_path, level)
    result = estimate(*paths, segment=1.28, overlap=0.0, window="boxcar", band=(0.7, 2999.0))
    assert result.warnings == ()
    assert check_frf(result.frf) == []
    assert result.frf.band is not None
    assert result.frf.band[0] < 100 < 2500 < result.frf.band[1]


@pytest.mark.parametrize("level", [1, 3])
def test_the_aircraft(shared_data: Path, level: int) -> None:
    path = shared_data / "f16-ground-vibration" / f"level_{level}.h5"
    result = estimate(path, segment=20.48, overlap=0.0, window="boxcar", band=(2.0, 15.0))
    assert result.warnings == ()
    assert check_frf(result.frf) == []


def test_both_levels_of_the_aircraft_agree_on_the_time(shared_data: Path) -> None:
    paths = [shared_data / "f16-ground-vibration" / f"level_{level}.h5" for level in (1, 3)]
    result = estimate(*paths, segment=20.48, overlap=0.0, window="boxcar", band=(2.0, 15.0))
    assert result.warnings == ()


@pytest.mark.long
@pytest.mark.parametrize("measured", [plane, beam])
def test_hammer_tests_of_others(shared_data: Path, measured: Callable[[Path], Frf]) -> None:
    frf = measured(shared_data)
    assert check_frf(frf) == []
    with pytest.raises(InputError, match="conjugate the values"):
        check_frf(replace(frf, values=frf.values.conj()))


@pytest.mark.parametrize("number", range(18))
def test_the_practice_cases(shared_data: Path, number: int) -> None:
    folder = shared_data.parent / "practice" / f"case_{number:02d}"
    assert check_model(read_modal_model(folder / "nominal.json")) == []
    assert check_recordings([folder / f"{name}.h5" for name in ("low", "mid", "high")]) == []
