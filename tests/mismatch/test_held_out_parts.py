"""What is held out of two recordings, or of one: the middle half of that which modal parameters follow worst."""

import numpy as np
import pytest
from concealed_recordings import RATE
from one_mode_rig import Rig

from estimation import BandRecording, WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, Settings, diagnose, fit
from millfrf.mismatch.faults.clipping_repair import residual_lines
from millfrf.mismatch.models.fitting import following_all, neglects_a_recording, plain_fit
from millfrf.mismatch.records.bands import Recordings
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure.held_out import recordings_of, scored
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


def test_parts_have_no_line_at_0_hz() -> None:
    """Compared from the first line on, as a slow path is; the logarithm of 0 Hz made the noise of the parts NaN."""
    rig = Rig()
    whole = windowed_spectrum(rig.recording("slow", rig.forces(20.0, 30.0, 1)), (1 / 30, 20.0), 1.0)
    assert whole.frequencies[0] < 0.05
    for part in (whole.between(0.0, 0.25), whole.between(0.25, 0.75)):
        assert part.frequencies[0] > 0


@pytest.mark.parametrize("count", [1, 2, 3])
def test_what_is_held_out(model: ModalModel, linear_trials: list[BandRecording], count: int) -> None:
    edges = band_of(model, RATE)
    lines = [windowed_spectrum(each, edges, 1.0) for each in (linear_trials * 2)[:count]]
    both = Recordings(lines, lines)
    fitted = both.others(lines)
    assert both.tested
    assert both.in_part is (count < 3)
    assert len(fitted) == 2 * (count if count < 3 else 1)
    if count < 3:
        unseen, first = both.held_out(lines), fitted[0]
        assert first.start + len(first.window) <= unseen.start
        assert unseen.start + len(unseen.window) <= fitted[1].start


@pytest.mark.long
@pytest.mark.parametrize("levels", [(1.0, 4.0), (4.0,)])
def test_a_law_is_confirmed_by_parts_of_its_own_levels(levels: tuple[float, ...]) -> None:
    """Before: fitted to the strong level alone, and let go of at the weak one."""
    rig = Rig().stiffened(0.3, 4.0)
    diagnosis = diagnose(rig.model, rig.recordings(levels, 40.0))
    assert [cause.name for cause in diagnosis.physics] == ["stiffness_hardening"]
    gain = diagnosis.improvement
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


def test_of_two_levels_the_one_that_modes_follow_worst_is_held_out() -> None:
    rig = Rig().stiffened(0.78, 4.0)
    lines = [windowed_spectrum(each, band_of(rig.model, rig.rate), 1.0) for each in rig.recordings((1.0, 4.0), 40.0)]
    shape = ModelShape(rig.model, LabError())
    true_when_weak = Hypothesis(shape, np.zeros(shape.size))
    assert recordings_of(lines, lines, true_when_weak).held_out_place == 1
    assert recordings_of(lines[::-1], lines[::-1], true_when_weak).held_out_place == 0


def test_a_fit_that_gives_no_recording_up_stays_as_it_is() -> None:
    rig = Rig().stiffened(0.78, 4.0)
    lines = [windowed_spectrum(each, band_of(rig.model, rig.rate), 1.0) for each in rig.recordings((1.0, 4.0), 40.0)]
    shape = ModelShape(rig.model, LabError())
    alone = fit(lines[:1], Hypothesis(shape, np.zeros(shape.size)), iterations=30)
    assert not neglects_a_recording(lines[:1], alone.hypothesis, 0.25)
    assert following_all(lines[:1], alone, 0.25) is alone
    both = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=30)
    assert neglects_a_recording(lines, both.hypothesis, 0.25)
    assert following_all(lines, both, 0.25).score <= both.score


def test_what_is_left_everywhere_counts_the_middle_of_both_levels() -> None:
    """Without a law: the modes that are true at the weak level leave nothing there, and much at the strong one."""
    rig = Rig().stiffened(0.78, 4.0)
    lines = [windowed_spectrum(each, band_of(rig.model, rig.rate), 1.0) for each in rig.recordings((1.0, 4.0), 40.0)]
    shape = ModelShape(rig.model, LabError())
    true_when_weak = Hypothesis(shape, np.zeros(shape.size))
    noises = fit(lines, true_when_weak, iterations=1).noises
    both = recordings_of(lines, lines, true_when_weak)
    result = scored(both, (true_when_weak, true_when_weak), noises, (), Settings().proof)
    weak = lines[0].between(0.25, 0.75)
    there = np.sqrt(np.sum(np.abs(residual_lines(true_when_weak, weak)) ** 2) / np.sum(np.abs(weak.measured) ** 2))
    strong = result.improvement.after
    assert result.improvement.held_out == "level_2"
    assert there < 0.5 * strong
    assert result.everywhere.after == pytest.approx(np.sqrt((there**2 + strong**2) / 2))
    assert not result.measured
