"""Forces and responses of recordings contradict each other: delays, clocks, signs, sizes, exchanged channels."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition import all_opened
from benchmarks.lab_cell import Record, draw_structure, shifted, sweeps
from millfrf.gate import check_consistency

RATE = 512.0
Written = Callable[[dict[str, Record]], list[Path]]


def three(seed: int) -> dict[str, Record]:
    rng = np.random.default_rng(seed)
    return sweeps(draw_structure(rng), rng)


def late(record: Record, seconds: float, first: int = 3, last: int = 6) -> None:
    record.samples[:, first:last] = shifted(record.samples[:, first:last], seconds, RATE)


def doubts(written: Written, records: dict[str, Record]) -> list[str]:
    with all_opened(written(records)) as recordings:
        return check_consistency(recordings)


@pytest.mark.parametrize("seed", range(4))
def test_right_recordings_give_no_doubt(written: Written, seed: int) -> None:
    assert doubts(written, three(seed)) == []


@pytest.mark.parametrize("seconds", [0.5, 0.02, -0.012])
def test_late_motions_in_all_recordings(written: Written, seconds: float) -> None:
    records = three(1)
    for record in records.values():
        late(record, seconds)
    (text,) = doubts(written, records)
    side = "behind" if seconds > 0 else "ahead of"
    assert text.startswith("all recordings: the responses are ")
    assert f"ms {side} the forces" in text
    stated, error = (float(text.split(word)[1].split()[0]) for word in ("responses are ", "+- "))
    assert abs(stated - 1e3 * abs(seconds)) < 3 * error < 8


@pytest.mark.parametrize("seed", [2, 3])
def test_motions_eight_samples_late_in_one_of_three(written: Written, seed: int) -> None:
    records = three(seed)
    late(records["down"], 8 / RATE)
    (text,) = doubts(written, records)
    assert text.startswith("down.h5: the responses are 15.6 +- ")


@pytest.mark.parametrize("factor", [1.01, 0.99, 1.0005])
def test_motions_on_another_clock(written: Written, factor: float) -> None:
    records = three(4)
    for record in records.values():
        at = np.arange(len(record.samples))
        record.samples[:, 3:] = np.column_stack([np.interp(factor * at, at, x) for x in record.samples[:, 3:].T])
    assert doubts(written, records)


def test_one_late_channel(written: Written) -> None:
    records = three(5)
    for record in records.values():
        late(record, 0.012, 4, 5)
    assert any("ay is" in text and "late" in text for text in doubts(written, records))


def scaled(columns: slice, factor: float) -> Callable[[np.ndarray], None]:
    def change(samples: np.ndarray) -> None:
        samples[:, columns] *= factor

    return change


def exchanged(a: int, b: int) -> Callable[[np.ndarray], None]:
    def change(samples: np.ndarray) -> None:
        samples[:, [a, b]] = samples[:, [b, a]]

    return change


CHANGES = {
    "ay has the opposite sign": scaled(slice(4, 5), -1.0),
    "fx has the opposite sign": scaled(slice(0, 1), -1.0),
    "fx and fy are exchanged": exchanged(0, 1),
    "ax and az are exchanged": exchanged(3, 5),
    "each response is 0.102 times its true size (g called m/s^2?)": scaled(slice(3, 6), 1 / 9.80665),
    "each response is 1000 times": scaled(slice(0, 3), 1e-3),
    "fy is too large": scaled(slice(1, 2), 1.25),
}


@pytest.mark.parametrize("says", CHANGES)
def test_one_recording_contradicts_the_others(written: Written, says: str) -> None:
    records = three(6)
    CHANGES[says](records["up"].samples)
    (text,) = doubts(written, records)
    assert text.startswith("up.h5 and central.h5, down.h5 belong to one structure only if, in up.h5, ")
    assert says in text


@pytest.mark.parametrize(("seed", "column"), [(11, 0), (11, 1), (23, 0), (23, 1), (23, 2)])
def test_coarse_forces_accuse_no_other_channel(written: Written, seed: int, column: int) -> None:
    """Forces in steps of 1.5 deviations gave "fz is 0.102 times its true size", beside the steps."""
    records = three(seed)
    for record in records.values():
        step = 1.5 * record.samples[:, column].std()
        record.samples[:, column] = step * np.rint(record.samples[:, column] / step)
    assert doubts(written, records) == []
