"""Labels: numbers, text that spells numbers, groups, and which of them count time."""

import pytest

from millfrf.campaign.results.regression import TIME, labels_of
from millfrf.campaign.results.sets import MeasuredSet


def _set(pose: str, recorded_at: float | None, **labels: str | float) -> MeasuredSet:
    return MeasuredSet(
        f"{pose}{labels}{recorded_at}", {"pose": pose, **labels}, None, recorded_at, (), None, None, None, ()
    )


def test_text_of_digits_is_a_number_and_a_note_says_so() -> None:
    result = labels_of([_set("P1", None, session="07"), _set("P1", None, session=10.0)])
    assert result.numbers["session"].tolist() == [7.0, 10.0]
    assert result.notes == ("label session is text of digits, such as 07: it is used as a number",)
    assert labels_of([_set("P1", None, session=1.0), _set("P1", None, session=2.0)]).notes == ()


@pytest.mark.parametrize("text", ["nan", "inf", "1e5", "1_0", "7a", "٣"])
def test_other_text_that_python_reads_as_a_number_is_text(text: str) -> None:
    result = labels_of([_set("P1", None, tool=text), _set("P1", None, tool="2")])
    assert not result.numbers
    assert result.texts["tool"] == (text, "2")


def test_a_session_that_rises_with_time_stands_for_time() -> None:
    sets = [_set(pose, 1e9 + 86400.0 * k, session=float(k)) for pose in ("P1", "P2") for k in range(3)]
    result = labels_of(sets)
    assert TIME not in result.numbers
    assert "session" in result.numbers
    assert any("session rises with the time" in note for note in result.notes)


def test_a_level_that_happens_to_vary_does_not_stand_for_time() -> None:
    sets = [_set("P1", 1e9 + 86400.0 * k, level=float(v)) for k, v in enumerate((3, 1, 2))]
    assert set(labels_of(sets).numbers) == {TIME, "level"}


def test_a_label_that_is_one_in_every_pose_cannot_be_looked_at() -> None:
    sets = [_set(pose, None, height=height) for pose, height in (("P1", 1.0), ("P1", 1.0), ("P2", 2.0))]
    assert not labels_of(sets).numbers


def test_remarks_are_no_groups() -> None:
    sets = [_set("P1", None, remark=f"note {k}", tool="A" if k % 2 else "B") for k in range(8)]
    result = labels_of(sets)
    assert set(result.texts) == {"tool"}
    assert any("remark" in note for note in result.notes)
