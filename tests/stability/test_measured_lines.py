"""Lobes straight from a measured accelerance: noise of the lowest lines is no flexibility and no slow chatter."""

from dataclasses import replace

import numpy as np
import pytest

from estimation import Frf
from millfrf.core import TIP
from millfrf.cutting import MillingProcess
from millfrf.stability import certified_lobes, known_lines, multi_frequency, nyquist_limits, zero_order
from millfrf.stability.tip_receptance import tool_receptance
from modal_fit import ModalModel
from replay_data import ACETAL_CUTTER, default_structure, tip_model

SPEEDS = np.linspace(1000.0, 4000.0, 7) * np.pi / 30
SLOT = replace(ACETAL_CUTTER, start_angle=0.0, exit_angle=np.pi)


def accelerance(model: ModalModel, noise: float, seed: int = 1, highest: float = 200.0) -> Frf:
    """An accelerance of the model with white noise, a share of its root mean square."""
    frequencies = np.arange(1, int(8 * highest)) / 8
    values = -((2 * np.pi * frequencies[:, None, None]) ** 2) * model.receptance(frequencies)
    rng = np.random.default_rng(seed)
    size = noise * np.sqrt(np.mean(np.abs(values) ** 2)) / np.sqrt(2)
    values = values + size * (rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape))
    return Frf(frequencies, values, model.responses, model.excitations, "accelerance", "m/s^2/N", frequencies > 0)


@pytest.mark.parametrize("process", [ACETAL_CUTTER, SLOT])
@pytest.mark.parametrize("solver", [certified_lobes, multi_frequency, zero_order, nyquist_limits])
def test_noise_of_the_lowest_lines_does_not_decide(solver: object, process: MillingProcess) -> None:
    """Before: 12 times too much, or a fortieth, at a chatter frequency below 2 Hz."""
    assert callable(solver)
    model = tip_model(default_structure())
    measured = accelerance(model, 0.005)
    truth = solver(model, process, SPEEDS, 0.05).depth_limits
    result = solver(measured, process, SPEEDS, 0.05)
    known = np.isfinite(truth)
    assert known.sum() >= 3
    np.testing.assert_allclose(result.depth_limits[known], truth[known], rtol=0.1)
    assert result.chatter_frequencies[known].min() > 5.0
    assert any("the receptance is noise" in said for said in result.warnings)


@pytest.mark.parametrize("seed", range(5))
def test_lines_are_left_out_up_to_where_noise_is_a_tenth_of_the_largest(seed: int) -> None:
    model = tip_model(default_structure())
    measured = accelerance(model, 0.02, seed)
    receptance = tool_receptance(measured)
    largest = np.linalg.norm(model.receptance(model.natural_frequencies), axis=(1, 2)).max()
    size = 0.02 * np.sqrt(np.mean(np.abs(accelerance(model, 0.0).values) ** 2)) * np.sqrt(9)
    even = np.sqrt(size / (0.1 * largest)) / (2 * np.pi)
    assert 0.5 * even < receptance.span[0] < 1.3 * even


def test_a_clean_measurement_loses_nothing() -> None:
    measured = accelerance(tip_model(default_structure()), 1e-9)
    assert tool_receptance(measured).span[0] == measured.frequencies[0]
    assert not tool_receptance(measured).warnings


def test_a_coarse_resonance_is_no_noise() -> None:
    """Two lines in a half-power band look rough; nothing below them is left out."""
    frequencies = np.arange(1, 200) / 2.0
    values = 1e-6 / (1 - (frequencies / 20) ** 2 + 2j * 0.012 * frequencies / 20)
    frf = Frf(frequencies, values[:, None, None], ("T:+X",), ("T:+X",), "receptance", "m/N", frequencies > 0)
    assert known_lines(frf) == (frf, ())


@pytest.mark.parametrize(
    ("mode", "damping", "lowest", "spacing"),
    [(12, 0.01, 11.5, 0.5), (12, 0.01, 10, 1.0), (17, 0.005, 16, 1.0), (12, 0.01, 5, 1.0), (3, 0.02, 2, 0.5)],
)
@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_coarse_resonance_at_the_begin_of_the_band_is_kept(
    mode: float, damping: float, lowest: float, spacing: float, noise: float
) -> None:
    """Without it the structure would seem stiffer than it is, and limits would be unsafe."""
    frequencies = np.arange(lowest, 200.0, spacing)
    values = 1e-6 / (1 - (frequencies / mode) ** 2 + 2j * damping * frequencies / mode)
    values += 3e-7 / (1 - (frequencies / 60) ** 2 + 2j * 0.02 * frequencies / 60)
    accelerances = values * (2 * np.pi * frequencies) ** 2
    drawn = np.random.default_rng(3).normal(size=(2, len(frequencies)))
    accelerances += noise * np.median(np.abs(accelerances)) * (drawn[0] + 1j * drawn[1])
    values = accelerances / (2 * np.pi * frequencies) ** 2
    frf = Frf(frequencies, values[:, None, None], ("T:+X",), ("T:+X",), "receptance", "m/N", frequencies > 0)
    used, said = known_lines(frf)
    assert used.frequencies[used.valid][0] == frequencies[0]
    assert said == ()


def test_lines_without_coherence_are_noise() -> None:
    measured = accelerance(tip_model(default_structure()), 1e-9)
    coherence = np.ones(measured.values.shape)
    coherence[measured.frequencies < 4.0] = 0.0
    values = measured.values.copy()
    values[measured.frequencies < 4.0] = 100.0
    stated = replace(measured, values=values, coherence=coherence, averages=np.full((3, 3), 20))
    assert tool_receptance(stated).span[0] == 4.0


def test_lines_outside_the_stated_band_are_not_used() -> None:
    measured = replace(accelerance(tip_model(default_structure()), 1e-9), band=(5.0, 60.0))
    assert tool_receptance(measured).span == (5.0, 60.0)
    assert measured.responses == TIP
