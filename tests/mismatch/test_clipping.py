"""A response that stops at a limit is found and repaired; one that friction keeps small is not called so."""

import numpy as np
import pytest
from concealed_recordings import Concealed, forces, linear_acceleration, structure, trial

from estimation import WindowedSpectrum, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, fit, library
from millfrf.mismatch.faults.clipping_repair import find_clipping, repair_clipping
from millfrf.mismatch.inference.search import Proposal
from millfrf.mismatch.inference.settings import EvidenceSettings
from millfrf.mismatch.models.fitting import Fit
from millfrf.mismatch.physics.linear_causes import MissingMode
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure.acceptance import corrects_clipping_repair
from modal_fit import ModalModel

OFF = np.array([1.01, 0.99])
DECAY = 1.7


def fitted_to(lines: list[WindowedSpectrum], model: ModalModel) -> Fit:
    shape = ModelShape(model, LabError())
    return fit(lines, Hypothesis(shape, np.zeros(shape.size)))


def cuts(
    limit: float, seed: int, law: Concealed | None = None, *, before: bool = False, duration: float = 40.0
) -> list[WindowedSpectrum]:
    """Two cuts; the second response saturates, with the noise on it or before it."""
    rng, model = np.random.default_rng(seed), structure()
    result = []
    for level in (30.0, 60.0):
        force = forces(rng, level, duration)
        shown = linear_acceleration(model, force) if law is None else law.acceleration(model, force)
        held = shown.copy()
        if not before:
            held[:, 1] = np.clip(shown[:, 1], -limit, limit)
        single = trial(f"{level:g} N", force, held, rng)
        if before:
            single.response[:, 1] = np.clip(single.response[:, 1], -limit, limit)
        result.append(windowed_spectrum(single, band_of(model, single.rate), DECAY))
    return result


def level_of(seed: int) -> float:
    return float(cuts(np.inf, seed)[1].recording.response[:, 1].std())


@pytest.mark.parametrize("before", [False, True])
@pytest.mark.parametrize("share", [0.8, 1.5, 2.2])
def test_found_and_mended(share: float, before: bool) -> None:
    """From a limit that cuts two of five samples to one that cuts one of a hundred."""
    limit = share * level_of(8)
    wrong = structure()
    lines = cuts(limit, 8, before=before)
    nominal = ModalModel(wrong.poles * OFF, wrong.right, wrong.left, wrong.responses, wrong.excitations)
    base = fitted_to(lines, nominal)
    clipping = find_clipping(base, lines)
    assert clipping is not None
    assert clipping.response == 1
    settled, repaired, clipping = repair_clipping(base, lines, clipping)
    assert clipping.saturation.limit == pytest.approx(limit, abs=max(4 * clipping.saturation.error, 1e-3 * limit))
    result, true = settled.hypothesis.model, structure()
    assert result.natural_frequencies == pytest.approx(true.natural_frequencies, rel=1e-3)
    assert result.damping_ratios == pytest.approx(true.damping_ratios, rel=0.02)
    whole = cuts(np.inf, 8)[1].recording.response[:, 1]
    off = repaired[1].recording.response[:, 1] - whole
    assert off.std() < 0.04 * whole.std()


@pytest.mark.long
def test_friction_that_keeps_a_response_small_is_no_limit() -> None:
    law = Concealed(lambda x, v: 25 * float(np.tanh(v / 2e-3)), np.array([0.3, 0.95]))
    lines = cuts(np.inf, 9, law, duration=15.0)
    shape = ModelShape(structure(), LabError())
    believed = fit(lines, Hypothesis(shape, np.zeros(shape.size)), iterations=1)
    assert find_clipping(believed, lines) is None
    assert find_clipping(fitted_to(lines, structure()), lines) is None


@pytest.mark.parametrize(
    ("shape", "evidence", "clipped", "expected"),
    [
        ((0.005, 1.0), 900.0, 1, True),
        ((0.005, 1.0), 1100.0, 1, False),  # more than a hundredth of the limit's evidence
        ((0.005, 1.0), 900.0, 0, False),  # another channel clips
        ((0.5, 1.0), 900.0, 1, False),  # the other channel shows it, too
    ],
)
def test_a_small_mode_that_a_clipped_channel_shows_alone_mends_it(
    shape: tuple[float, float], evidence: float, clipped: int, expected: bool
) -> None:
    """Before: a mode of 748 was told beside a clipped channel of 320555 (extended seed 4602, case 16)."""
    lines, model = cuts(np.inf, 8, duration=10.0), ModelShape(structure(), LabError())
    base = Hypothesis(model, np.zeros(model.size))
    physics = library()["missing_mode"]
    assert isinstance(physics, MissingMode)
    left = np.ones(len(structure().excitations), dtype=complex)
    mode = base.with_mode(-1 + 60j, np.array(shape, dtype=complex), left, physics)
    proposal = Proposal("missing_mode", {}, Fit(mode, (), 0.0, 0.0, 0.0, np.zeros((1, 1))), evidence)
    assert corrects_clipping_repair(proposal, {clipped: 1e5}, lines, EvidenceSettings()) is expected
    assert not corrects_clipping_repair(proposal, {}, lines, EvidenceSettings())
