"""The growth with the level is drawn, or a sentence says why it is not: no empty picture."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from millfrf.mismatch import StructureDiagnosis
from millfrf.reports.diagnoses.structure_page import growth_section


def told(amplitude: list[float | None], recordings: int = 3, **more: Any) -> Any:
    """A section for a residual of these amplitudes at 10, 20 and 40."""
    part = {
        "force_rms_n": [10.0, 20.0, 40.0],
        "amplitude": amplitude,
        "standard_error": [0.001] * 3,
        "noise": [0.01] * 3,
        "exponent": None,
        "exponent_standard_error": None,
    }
    result = {
        "located": {"growth": {"residual": part | more}},
        "details": SimpleNamespace(recordings=[None] * recordings),
    }
    return growth_section(cast(StructureDiagnosis, SimpleNamespace(**result)))


@pytest.mark.parametrize(
    ("amplitude", "recordings", "says"),
    [([0.0, 0.0, 0.0], 3, "no larger than their noise"), ([0.1, 0.2, 0.3], 1, "a single recording")],
)
def test_a_reason_stands_where_nothing_can_be_drawn(amplitude: list[float | None], recordings: int, says: str) -> None:
    section = told(amplitude, recordings)
    assert section.pictures == ()
    assert says in section.sentences[0]


def test_nothing_located_says_so() -> None:
    note = SimpleNamespace(
        located={"growth": {"note": "nothing stands above the noise, so nothing grows"}},
        details=SimpleNamespace(recordings=[None] * 2),
    )
    section = growth_section(cast(StructureDiagnosis, note))
    assert section.sentences == ("Not drawn: nothing stands above the noise, so nothing grows.",)


def test_recordings_of_one_level_show_no_growth() -> None:
    section = told([0.1, 0.2, 0.3], force_rms_n=[20.0, 20.1, 20.3])
    assert section.pictures == ()
    assert "nearly one level, 20 to 20.3 N" in section.sentences[0]


def test_what_stands_above_the_noise_is_drawn() -> None:
    assert len(told([0.0, 0.0, 0.3]).pictures) == 1


def test_a_drive_in_volts_is_drawn_in_volts() -> None:
    section = told([0.1, 0.2, 0.3], force_rms_n=None, drive_rms=[1.0, 2.0, 4.0], drive_unit="V")
    assert len(section.pictures) == 1
