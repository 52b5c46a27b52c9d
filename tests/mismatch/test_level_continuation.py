"""Joint laws carried from level to level: found where all levels at once mislead, and silent where levels are alike."""

import numpy as np
import pytest
from one_mode_rig import Rig

from estimation import WindowedSpectrum, windowed_spectrum
from millfrf.core import InputError
from millfrf.mismatch import Hypothesis, JointPhysics, LabError, ModelShape, SearchSettings, Settings, fit, library
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.screening.joint_laws_fitted import joint_candidates, laws_by_level, screened_laws

LEVELS = (20.0, 40.0, 60.0)


def _began(levels: tuple[float, ...], share: float) -> tuple[Rig, list[WindowedSpectrum], Fit, list[JointPhysics]]:
    rig = Rig().stiffened(share, LEVELS[-1])
    lines = [windowed_spectrum(each, band_of(rig.model, each.rate), 1.0) for each in rig.recordings(levels)]
    shape = ModelShape(rig.model, LabError())
    base = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=30)
    return rig, lines, base, [each for each in library().values() if isinstance(each, JointPhysics)]


@pytest.mark.long
def test_a_law_of_more_than_the_stiffness_is_found_where_all_levels_at_once_miss_it() -> None:
    rig, lines, base, laws = _began(LEVELS, 1.5)
    carried = max(laws_by_level(lines, base, laws, Settings()), key=lambda one: one.evidence)
    at_once = joint_candidates(lines, base, screened_laws(lines, base, laws, Settings()), Settings(), 0.0)
    assert carried.evidence > max((one.evidence for one in at_once), default=0.0) + 1000
    assert carried.name == "stiffness_hardening"
    values = dict(zip(("force", "exponent"), carried.fitted.hypothesis.causes[-1].values, strict=False))
    assert values["exponent"] == pytest.approx(3.0, abs=0.03)
    assert values["force"] == pytest.approx(rig.cubic * 1e-9, rel=0.03)
    assert carried.fitted.hypothesis.model.natural_frequencies[0] == pytest.approx(rig.frequency, rel=0.01)


def test_levels_that_are_alike_carry_nothing() -> None:
    _, lines, base, laws = _began((40.0, 44.0), 0.3)
    assert laws_by_level(lines, base, laws, Settings()) == []


def test_a_linear_rig_has_no_law_to_carry() -> None:
    _, lines, base, laws = _began(LEVELS, 0.0)
    assert all(each.evidence < 20 for each in laws_by_level(lines, base, laws, Settings()))


def test_a_factor_between_levels_that_says_nothing_is_refused() -> None:
    with pytest.raises(InputError, match="levels_apart"):
        SearchSettings(levels_apart=-1.0)
