"""What is held out of two recordings, or of one: the middle half of the weaker, predicted from its beginning."""

import numpy as np
import pytest
from concealed_recordings import RATE
from one_mode_rig import Rig

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from mismatch import Hypothesis, LabError, ModelShape, band_of, diagnose
from mismatch.adapters.structure.held_out import Recordings
from mismatch.faults import residual_lines
from mismatch.models import fit, plain_fit
from modal_fit import ModalModel


def test_a_part_is_predicted_as_well_as_the_whole(model: ModalModel, linear_trials: list[BandRecording]) -> None:
    """Force before the part moves the structure in it: what the true model leaves there is noise alone."""
    shape = ModelShape(model, LabError())
    true = Hypothesis(shape, np.zeros(shape.size))
    whole = windowed_spectrum(linear_trials[0], band_of(model, RATE), float((-model.poles.real).min()))
    level = np.mean(np.abs(residual_lines(true, whole)) ** 2)
    for part in (whole.between(0.0, 0.25), whole.between(0.25, 0.75), whole.between(0.75, 1.0)):
        assert np.sum(part.window**2) == pytest.approx(1.0)
        assert len(part.frequencies) == pytest.approx(
            len(whole.frequencies) * len(part.window) / len(whole.window), 0.1
        )
        assert np.mean(np.abs(residual_lines(true, part)) ** 2) == pytest.approx(level, rel=0.25)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_what_is_held_out(model: ModalModel, linear_trials: list[BandRecording], count: int) -> None:
    edges = band_of(model, RATE)
    lines = [windowed_spectrum(one, edges, 1.0) for one in (linear_trials * 2)[:count]]
    both = Recordings(lines, lines)
    fitted = both.others(lines)
    assert both.tested
    assert both.in_part is (count < 3)
    assert len(fitted) == 2 * (count if count < 3 else 1)
    if count < 3:
        unseen, first = both.held_out(lines), fitted[0]
        assert first.start + len(first.window) <= unseen.start
        assert unseen.start + len(unseen.window) <= fitted[1].start


@pytest.mark.parametrize("levels", [(1.0, 4.0), (4.0,)])
def test_a_law_is_confirmed_by_parts_of_its_own_levels(levels: tuple[float, ...]) -> None:
    """Before: fitted to the strong level alone, and let go of at the weak one."""
    rig = Rig().stiffened(0.3, 4.0)
    found = diagnose(rig.model, rig.recordings(levels, 40.0))
    assert [cause.name for cause in found.physics] == ["stiffness_hardening"]
    gain = found.improvement
    assert gain.part
    assert gain.p_value < 0.01
    assert gain.after < 1.3 * gain.noise_floor


def test_a_plain_refit_gives_no_recording_up() -> None:
    """The strong level stiffens by three quarters; inferred noise takes what a linear refit leaves there for noise."""
    rig = Rig().stiffened(0.78, 4.0)
    lines = [windowed_spectrum(one, band_of(rig.model, rig.rate), 1.0) for one in rig.recordings((1.0, 4.0), 40.0)]
    shape = ModelShape(rig.model, LabError())
    start = Hypothesis(shape, np.zeros(shape.size))
    plain, weighted = plain_fit(lines, start, iterations=30), fit(lines, start, iterations=30)
    strong, weak = lines[1], lines[0]

    def left(hypothesis: Hypothesis, one: WindowedSpectrum) -> float:
        return float(np.sum(np.abs(residual_lines(hypothesis, one)) ** 2))

    assert left(plain.hypothesis, strong) < 0.9 * left(weighted.hypothesis, strong)
    assert left(plain.hypothesis, weak) > left(weighted.hypothesis, weak)
    assert np.ptp(plain.noises[1].responses) == 0.0
