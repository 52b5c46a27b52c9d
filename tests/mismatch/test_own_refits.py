"""What modes of a recording's own follow is no noise: an answer that leaves much of it is not whole."""

from dataclasses import replace

import numpy as np
import pytest
from one_mode_rig import Rig

from estimation import BandRecording
from millfrf.mismatch import Settings, StructureDiagnosis, diagnose, library
from millfrf.mismatch.behaviour.level_refit import better_refits
from millfrf.mismatch.inference.settings import VerdictSettings

FORCES = (20.0, 40.0, 60.0)


def diagnosed(recordings: list[BandRecording], off: float) -> StructureDiagnosis:
    """A rig whose law the library does not hold, from a nominal model whose frequency is off by a factor."""
    known = {name: each for name, each in library().items() if name in ("channel_delay", "gain_error")}
    model = replace(Rig().model, poles=off * Rig().model.poles, band=(4.0, 22.0))
    return diagnose(model, recordings, Settings(causes=known))


def noisy(recordings: list[BandRecording], ratio: float) -> list[BandRecording]:
    """The recordings with white noise on their responses, as a ratio of the root mean square of the response."""
    draws = np.random.default_rng(4)
    return [
        replace(each, response=each.response + ratio * each.response.std() * draws.standard_normal(each.response.shape))
        for each in recordings
    ]


@pytest.mark.parametrize(("off", "verdict"), [(1.02, "unexplained"), (1.05, "partly explained")])
def test_a_law_that_is_not_in_the_library_is_not_taken_for_noise_of_the_loud_recordings(
    off: float, verdict: str
) -> None:
    """Five per cent of hardening: modes fitted to all leave 41 % of the loudest recording, its own leave 20 %."""
    diagnosis = diagnosed(Rig().stiffened(0.05, FORCES[-1]).recordings(FORCES, 20.0), off)
    assert diagnosis.verdict == verdict
    said = [doubt for doubt in diagnosis.doubts if "is not noise, so the answer is incomplete" in doubt]
    assert [doubt.split(" of ")[1].split(",")[0] for doubt in said] == ["level_2", "level_3"]


def test_noise_is_still_noise() -> None:
    """A linear rig in noise: a fifth of each recording is left, and no refit of one alone follows it."""
    diagnosis = diagnosed(noisy(Rig().recordings(FORCES, 20.0), 0.4), 1.05)
    assert (diagnosis.verdict, [cause.name for cause in diagnosis.physics]) == ("explained", ["modal_parameters"])
    assert not diagnosis.doubts
    assert diagnosis.improvement.after > 0.15


def test_numbers_of_the_refit_are_put_back() -> None:
    """Over many draws the refit leaves as much of pure noise as the true model does, once its numbers are counted."""
    rig = Rig()
    diagnosis = diagnosed(rig.recordings(FORCES, 20.0), 1.0)
    base = diagnosis.details.base.hypothesis
    loose = VerdictSettings(most_over_alone=1e-9, most_not_noise=1e-9)
    ratios = []
    for seed in range(6):
        draws = np.random.default_rng(seed)
        for item in diagnosis.details.measured:
            noise = item.measured.std() * (draws.standard_normal((2, *item.measured.shape)))
            spoiled = replace(item, measured=item.measured + (noise[0] + 1j * noise[1]))
            ratios += [each.left / each.alone for each in better_refits(base, base, [spoiled], loose)]
    assert ratios
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.01)
