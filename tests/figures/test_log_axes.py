"""Logarithmic axes: few ticks, at round places, all of them inside."""

import numpy as np
import pytest
from matplotlib.axes import Axes

from millfrf.figures import house_style, new_figure
from millfrf.figures.style import decade_axis, plain_log_axis


def _axes() -> Axes:
    with house_style():
        return new_figure(60.0, None).subplots()


def _labels(axes: Axes, side: str) -> list[str]:
    axes.figure.canvas.draw()
    low, high = sorted(getattr(axes, f"get_{side}lim")())
    axis = getattr(axes, f"{side}axis")
    pairs = zip(axis.get_ticklocs(), axis.get_ticklabels(), strict=True)
    return [text.get_text() for place, text in pairs if low <= place <= high]


def test_plain_numbers_stand_at_1_2_and_5() -> None:
    axes = _axes()
    plain_log_axis(axes, "x", 4.08, 75.6)
    assert _labels(axes, "x") == ["5", "10", "20", "50"]
    assert axes.get_xlim() == (4.08, 75.6)
    assert not len(axes.xaxis.get_minorticklocs())


@pytest.mark.parametrize(
    ("low", "high", "labels"),
    [
        (3e-4, 6.0, ["10⁻³", "10⁻²", "10⁻¹", "10⁰"]),
        (2.0, 40.0, ["2", "5", "10", "20"]),
        (1e-9, 2e3, ["10⁻⁹", "10⁻⁶", "10⁻³", "10⁰", "10³"]),
    ],
)
def test_decades_are_labelled_and_thinned_out(low: float, high: float, labels: list[str]) -> None:
    axes = _axes()
    decade_axis(axes, "y", low, high)
    assert _labels(axes, "y") == labels


def test_small_marks_stand_at_two_to_nine_times_the_decades() -> None:
    axes = _axes()
    decade_axis(axes, "y", 0.5, 30.0)
    (marks,) = [artist for artist in axes.lines + axes.artists if artist.get_linestyle() == "None"]
    np.testing.assert_allclose(marks.get_ydata(), [0.6, 0.7, 0.8, 0.9, *range(2, 10), 20], rtol=1e-12)
    assert axes.get_ylim() == (0.5, 30.0)
