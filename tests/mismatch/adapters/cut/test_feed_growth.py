"""Waveforms that the model does not explain, by a line over the feed through the other cuts."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy

from millfrf.mismatch import CutForces, identify_coefficients
from millfrf.mismatch.cut.identification.feed_growth import left_out_by_feed

from .loop_forces import RATE, loop_forces
from .test_identification import NAMES, cutter, orders_of

FEEDS = (25e-6, 50e-6, 75e-6, 100e-6)
BEGINS = 1.7 * np.arange(len(FEEDS))


def cuts_behind_a_filter(**options: object) -> list[CutForces]:
    """Slots behind two resonances and a delay, which no mode along an axis explains."""
    low, high = 2 * np.pi * 450, 2 * np.pi * 720
    sections = np.polymul([1.0, 0.06 * low, low**2], [1.0, 0.06 * high, high**2])
    numerator, denominator = scipy.signal.bilinear([low**2 * high**2], sections, RATE)
    delayed = np.concatenate([np.zeros(7), numerator])
    cuts = []
    for number, feed in enumerate(FEEDS):
        given: dict[str, Any] = {"first_angle": BEGINS[number], "seed": number, "runout": 0.0, "noise": 0.005} | options
        force = loop_forces(feed, **given)
        seen = scipy.signal.lfilter(delayed, denominator, force, axis=0)[2000:]
        cuts.append(orders_of(seen, cutter(feed=feed)))
    return cuts


def test_a_line_over_the_feed_predicts_cuts_behind_any_filter() -> None:
    cuts = cuts_behind_a_filter()
    result = identify_coefficients(cuts, NAMES)
    assert result.fit.misfit > 0.15
    left_out = left_out_by_feed(cuts, result.fit.angles)
    assert left_out is not None
    assert left_out.shape == (2,)
    assert left_out.max() < 0.02
    assert any("of a cut between others that is left out" in doubt for doubt in result.warnings)


def test_a_cut_of_another_kind_is_not_on_the_line() -> None:
    """A third more force in one cut, as after a tooth was lost, is missed by as much."""
    cuts = cuts_behind_a_filter()
    cuts[2] = replace(cuts[2], mean=1.5 * cuts[2].mean)
    left_out = left_out_by_feed(cuts, BEGINS)
    assert left_out is not None
    assert left_out[1] == pytest.approx(1 / 3, abs=0.02)


def test_pressure_that_falls_with_the_chip_bends_the_line() -> None:
    """A force that grows with the square root of the chip misses the line by what the root of the feed does."""
    coefficients = np.array([3e7, 1e7, 5e6, 0.0, 0.0, 0.0])
    cuts = cuts_behind_a_filter(powers=(0.5, 0.5, 0.5), round_edge=1e-9, coefficients=coefficients, helix=0.0)
    left_out = left_out_by_feed(cuts, BEGINS)
    assert left_out is not None
    for number, missed in enumerate(left_out, start=1):
        others = np.delete(FEEDS, number)
        line = np.polynomial.Polynomial.fit(others, np.sqrt(others), 1)
        assert missed == pytest.approx(abs(1 - line(FEEDS[number]) / np.sqrt(FEEDS[number])), rel=0.1)


@pytest.mark.parametrize("change", [{"depth": 0.002}, {"turning": np.array([90.0])}, {"process": cutter(feed=25e-6)}])
def test_cuts_that_differ_in_more_than_the_feed_are_not_compared(change: dict[str, Any]) -> None:
    cuts = cuts_behind_a_filter()
    assert left_out_by_feed([*cuts[:3], replace(cuts[3], **change)], BEGINS) is None
    assert left_out_by_feed(cuts[:3], BEGINS[:3]) is None
