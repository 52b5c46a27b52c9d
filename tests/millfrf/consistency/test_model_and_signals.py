"""A model against another recording, coarse rounding, and mains hum."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from benchmarks.lab_cell import Record, draw_structure, shifted, sweeps
from millfrf.core import MillfrfError
from millfrf.gate import check_recordings
from millfrf.steps.fit import fit
from millfrf.steps.predict import predict

RATE = 512.0
Written = Callable[[dict[str, Record]], list[Path]]
pytestmark = pytest.mark.filterwarnings("ignore::millfrf.core.MillfrfWarning")


def three(seed: int, noise: int = 0) -> dict[str, Record]:
    structure = draw_structure(np.random.default_rng(seed))
    return sweeps(structure, np.random.default_rng(1000 * seed + noise))


def test_a_prediction_that_fails_is_doubted_and_explained(written: Written, tmp_path: Path) -> None:
    fitted = fit(*written(three(1)), band=(13.0, 25.0))
    assert fitted.warnings == ()
    other = three(1, 1)["down"]
    right = predict(fitted.model, other.write(tmp_path / "right.h5"))
    assert right.warnings == ()
    assert right.prediction.total_error < 0.03
    other.samples[:, 3:] = 0.7 * shifted(other.samples[:, 3:], 0.01, RATE)
    wrong = predict(fitted.model, other.write(tmp_path / "wrong.h5"))
    (text,) = wrong.warnings
    assert wrong.prediction.total_error > 1
    assert "does not describe this recording" in text
    assert float(text.split("measured is ")[1].split()[0]) == pytest.approx(0.7, abs=0.02)
    assert float(text.split("predicted, ")[1].split()[0]) == pytest.approx(10, abs=0.6)


@pytest.mark.filterwarnings("always::millfrf.core.MillfrfWarning")
def test_late_motions_are_named_even_where_the_fit_fails(written: Written) -> None:
    records = three(2)
    for record in records.values():
        record.samples[:, 3:] = shifted(record.samples[:, 3:], 0.5, RATE)
    with pytest.warns(match="500 .* ms behind the forces"), suppress(MillfrfError):
        fit(*written(records), band=(13.0, 25.0))


def test_a_step_of_half_a_standard_deviation(tmp_path: Path) -> None:
    single = three(3)["up"]
    assert check_recordings([single.write(tmp_path / "fine.h5")]) == []
    step = 0.5 * single.samples[:, 0].std()
    single.samples[:, 0] = step * np.rint(single.samples[:, 0] / step)
    (text,) = check_recordings([single.write(tmp_path / "coarse.h5")])
    assert "fx: steps of" in text
    assert "rounding is noise of 14 % of the signal" in text


@pytest.mark.parametrize("mains", [50.02, 59.97])
def test_mains_hum(tmp_path: Path, mains: float) -> None:
    single = three(4)["down"]
    time = np.arange(len(single.samples)) / RATE
    single.samples[:, 4] += 0.6 * single.samples[:, 4].std() * np.sin(2 * np.pi * mains * time)
    (text,) = check_recordings([single.write(tmp_path / "hum.h5")])
    assert f"mains hum in ay at {round(mains, -1):g} Hz" in text
