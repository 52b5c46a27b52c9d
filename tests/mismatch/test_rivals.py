"""Fits that must come near another one: hopeless ones end early, and others end where they would."""

from dataclasses import replace

import numpy as np
import pytest
from hidden_joint import law_of, with_law
from one_mode_rig import Rig

from estimation import WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, fit
from millfrf.mismatch.models.fitting import Fit, Rival
from millfrf.mismatch.records.reading import band_of

FRICTION = np.array([3.0, 2e-3])


@pytest.fixture(scope="module")
def lines() -> list[WindowedSpectrum]:
    rig = Rig()
    return [windowed_spectrum(each, band_of(rig.model, 128.0), 1.0) for each in rig.recordings((1.0, 2.0), 30.0)]


@pytest.fixture(scope="module")
def plain(lines: list[WindowedSpectrum]) -> Fit:
    shape = ModelShape(Rig().model, LabError())
    return fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=4)


def test_a_fit_that_reaches_its_rival_ends_where_it_would(lines: list[WindowedSpectrum], plain: Fit) -> None:
    """A linear rig is fitted with friction that it does not have: the friction goes, and the rival is reached."""
    start = with_law(law_of("coulomb_friction"), FRICTION)
    alone, beside = fit(lines, start), fit(lines, start, rival=Rival(plain, 20.0))
    assert beside.score == pytest.approx(alone.score, abs=1e-6)
    assert beside.score < plain.score + 20.0


def test_a_fit_without_hope_ends_early_and_stays_behind(lines: list[WindowedSpectrum], plain: Fit) -> None:
    start = with_law(law_of("coulomb_friction"), FRICTION)
    out_of_reach = replace(plain, misfit=plain.misfit - 1e6)
    alone, beside = fit(lines, start), fit(lines, start, rival=Rival(out_of_reach))
    assert alone.score < beside.score
    assert beside.score > out_of_reach.score


def test_the_goal_on_a_few_lines_holds_a_share_of_what_may_be_behind(lines: list[WindowedSpectrum], plain: Fit) -> None:
    few = [each.thinned(100) for each in lines]
    near, far = (Rival(plain, behind).goal_on(few, lines) for behind in (0.0, 1000.0))
    share = sum(len(each.frequencies) for each in few) / sum(len(each.frequencies) for each in lines)
    assert far - near == pytest.approx(1000.0 * share)
    assert Rival(plain, 1000.0).goal == pytest.approx(plain.misfit + plain.deviation + 1000.0)
