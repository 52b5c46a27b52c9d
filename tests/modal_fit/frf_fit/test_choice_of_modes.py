"""Which modes an automatic fit takes: a slender tool tapped at five points, one tap, tones, and stated doubts."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import MillfrfError
from modal_fit import fit_polyreference
from modal_fit.frf_fit.candidates import Candidate
from modal_fit.frf_fit.elimination import Modes
from modal_fit.frf_fit.measured_lines import measured_lines
from modal_fit.frf_fit.selection import Selection, off_columns

Complex = NDArray[np.complex128]
AXIS = np.arange(300.0, 3600.0, 2.0)
BAND = (500.0, 3500.0)
FREQUENCIES = np.array([1070.0, 1255.0, 1970.0, 2605.0, 2735.0])
DAMPINGS = np.array([0.032, 0.045, 0.045, 0.021, 0.022])
COMPLIANCES = np.array([40.0, 7.0, 20.0, 12.0, 10.0]) * 1e-9  # m/N at the tip
PLACES = np.linspace(0.0, 1.0, 5)  # tip to holder


def shapes() -> NDArray[np.float64]:
    """Deflections of a stiff holder and a slender tool, nearly alike at all points, 1 at the tip: (modes, points)."""
    return np.array([1 - (1.0 - 0.05 * k) * PLACES**0.7 for k in range(5)]) + 0.15 * np.outer(
        [0.0, 0.1, -0.6, -0.3, -0.2], PLACES
    )


def receptance(number: int, frequency: float, damping: float, axis: NDArray[np.float64] = AXIS) -> Complex:
    """One mode at the tip, m/N."""
    omega, own = 2 * np.pi * axis, 2 * np.pi * frequency
    return np.asarray(COMPLIANCES[number] * own**2 / (own**2 - omega**2 + 2j * damping * own * omega))


def tool(seed: int, points: int = 5, drift: float = 0.002, noise: float = 0.003) -> Frf:
    """Taps along the tool, each with frequencies and dampings of its own by ``drift``, and white noise."""
    rng = np.random.default_rng(seed)
    values = np.zeros((len(AXIS), 1, points), dtype=complex)
    for point in range(points):
        for number in range(5):
            f = FREQUENCIES[number] * (1 + drift * rng.standard_normal())
            zeta = DAMPINGS[number] * (1 + 20 * drift * rng.standard_normal())
            values[:, 0, point] += shapes()[number, point] * receptance(number, f, zeta)
    acceleration = values * -((2 * np.pi * AXIS) ** 2)[:, None, None]
    level = noise * np.sqrt(np.mean(np.abs(acceleration) ** 2)) / np.sqrt(2)
    acceleration += level * (rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape))
    places = tuple(f"P{point + 1}:+Z" for point in range(points))
    usable = np.ones(len(AXIS), dtype=bool)
    return Frf(AXIS, acceleration, ("P1:+Z",), places, "accelerance", "m/s^2/N", usable)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_five_taps_of_a_slender_tool_give_its_five_modes(seed: int) -> None:
    """Shapes are alike and two modes 5 % apart: neither is a copy of the other."""
    shape = shapes()
    size = np.linalg.norm(shape, axis=1)
    assert ((shape @ shape.T / np.outer(size, size)) ** 2).min() > 0.8
    fit = fit_polyreference(tool(seed), BAND)
    np.testing.assert_allclose(fit.model.natural_frequencies, FREQUENCIES, rtol=0.01)
    np.testing.assert_allclose(fit.model.damping_ratios, DAMPINGS, rtol=0.2)
    responses, excitations = fit.explained
    assert responses.shape == (1,)
    assert excitations.shape == (5,)
    np.testing.assert_allclose(1 - excitations, fit.relative_error[0] ** 2, rtol=1e-9)
    assert excitations.min() > 0.98


@pytest.mark.parametrize("noise", [0.01, 0.3])
def test_one_tap_gives_few_modes_and_none_that_is_uncertain(noise: float) -> None:
    for seed in range(3):
        model = fit_polyreference(tool(seed, points=1, noise=noise), BAND).model
        assert model.errors is not None
        assert 2 <= len(model.poles) <= 6
        assert np.all(model.errors.frequency < 0.2 * model.natural_frequencies)
        assert np.all((model.damping_ratios > 0) & (model.damping_ratios < 0.3))
        off = np.abs(np.log(model.natural_frequencies[:, None] / FREQUENCIES)).min(axis=1)
        assert off.max() < 0.05


def test_a_tone_is_no_mode() -> None:
    """A tone of the mains fills one line of the FRF; its damping is zero."""
    frf = tool(4, points=1, noise=0.01)
    values = frf.values.copy()
    values[np.searchsorted(AXIS, 1500.0)] *= 30
    model = fit_polyreference(replace(frf, values=values), BAND).model
    assert np.abs(model.natural_frequencies - 1500.0).min() > 50


def test_a_small_peak_is_a_mode_or_a_doubt() -> None:
    frf = tool(5)
    small = 0.035 * receptance(0, 1650.0, 0.01) * -((2 * np.pi * AXIS) ** 2)
    values = frf.values + np.einsum("k,p->kp", small, shapes()[1])[:, None, :]
    fit = fit_polyreference(replace(frf, values=values), BAND)
    named = [float(f) for text in fit.warnings for f in re.findall(r"no mode at ([\d.]+) Hz", text)]
    assert np.abs(np.array([*fit.model.natural_frequencies, *named]) / 1650.0 - 1).min() < 0.01


def test_a_mode_off_every_column_is_a_doubt() -> None:
    """One wide mode between two columns is none of them."""

    def pole(frequency: float, damping: float) -> complex:
        return 2 * np.pi * frequency * complex(-damping, np.sqrt(1 - damping**2))

    frf = tool(6, points=1)
    inside = (BAND[0] < AXIS) & (BAND[1] > AXIS)
    lines = measured_lines(frf, inside, BAND, np.ones((int(inside.sum()), 1, 1)))
    columns = tuple(Candidate(pole(f, 0.022), 0.9, 50, np.ones(1, dtype=complex)) for f in (2605.0, 2735.0))
    modes = Modes(np.array([pole(2670.0, 0.043)]), np.ones((1, 1), dtype=complex))
    selection = Selection(modes, columns[:1], ((columns[1], "a reason"),), lines)
    assert [text for text in off_columns(modes, selection) if "2670 Hz" in text]
    at_column = Modes(np.array([pole(2608.0, 0.024)]), modes.left)
    assert not list(off_columns(at_column, selection))


def test_noise_has_no_mode() -> None:
    rng = np.random.default_rng(7)
    frf = tool(7, points=1)
    noise = rng.standard_normal(frf.values.shape) + 1j * rng.standard_normal(frf.values.shape)
    with pytest.raises(MillfrfError, match=r"no (mode|pole)"):
        fit_polyreference(replace(frf, values=noise), BAND)
