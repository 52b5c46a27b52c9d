"""Spectra of the taps of one test, summed over taps."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from acquisition import Channel
from millfrf.core import Band, Complex, Index, InputError, Real

from ..band_recordings.channel_matching import before_high_pass
from ..frf.quantities import frf_quantity
from .segments import TapSettings, exponential_window, force_window, segments_of
from .taps import FoundTaps


@dataclass(frozen=True)
class TapSums:
    """Products of the spectra of forces f and responses x, summed over the taps of one test."""

    name: str  # of the test, for messages
    frequencies: Real  # (n_frequencies,), Hz
    input_power: Complex  # (n_frequencies, n_excitations, n_excitations); products of the forces, ``sum f_i conj(f_j)``
    # (n_frequencies, n_responses, n_excitations); products of responses and forces, ``sum x_p conj(f_q)``
    cross: Complex
    output_power: Real  # (n_frequencies, n_responses); power of the responses, ``sum |x_p|^2``
    excitations: tuple[str, ...]  # degrees of freedom
    responses: tuple[str, ...]
    counts: Index  # (n_excitations,); number of taps that hit each excitation hardest
    quantity: str  # of responses over forces
    unit: str
    grounded: bool  # whether responses are valid down to 0 Hz: none of their sensors has a high-pass


def tap_sums(taps: FoundTaps, settings: TapSettings, band: Band | None = None, places: Collection[str] = ()) -> TapSums:
    """Cut, window, transform and sum the usable taps of a test.

    The force is cut off after the contact; where there is an exponential window, force and response are multiplied by
    it. Known input delays and the sensors' high-passes are removed, at the ``s = i w + 1/tau`` of the spectra. A force
    channel on which no tap has its largest force is left out.

    Parameters
    ----------
    taps
        Taps of the test; at least one is usable.
    settings
        Lengths of the segments, and windows.
    band : Hz
        Lowest and highest frequency of the lines to keep; None: all.
    places
        Degrees of freedom that taps of other tests hit; their force channels are kept here as well, because an oblique
        tap also acts there.

    Raises
    ------
    InputError
        No usable tap, two channels at one place, responses of different quantities, or a band without lines.
    """
    test, tau = taps.test, settings.time_constant
    if not taps.used:
        raise InputError(f"{test.path.name}: no tap can be used; tap again, or leave the file out")
    hardest = [tap.tap.channel for tap in taps.used]
    hit = [k for k, channel in enumerate(test.excitations) if k in hardest or channel.degree_of_freedom in places]
    forces = [test.excitations[k] for k in hit]
    _check_places(forces, test.path.name)
    _check_places(test.responses, test.path.name)
    quantity, unit = frf_quantity(test.responses, forces)
    f = np.asarray(np.fft.rfftfreq(settings.length, 1 / settings.sample_rate), dtype=float)
    chosen = np.ones(len(f), dtype=bool) if band is None else (f >= band[0]) & (f <= band[1])
    if band is not None and not chosen.any():
        raise InputError(
            f"no line lies between {band[0]:g} and {band[1]:g} Hz (segments of {settings.duration:g} s have lines up "
            f"to {f[-1]:g} Hz, {f[1]:.3g} Hz apart); widen the band"
        )
    f, n = f[chosen], len(forces)
    # an exponential window moves the lines to i w + 1/tau, where delays and high-passes have other factors
    s = np.asarray(2j * np.pi * f + (0.0 if tau is None else 1 / tau), dtype=np.complex128)
    windows = _windows(settings, n, len(test.responses))
    factors = np.column_stack([_correction(channel, s) for channel in (*forces, *test.responses)])
    columns = [*hit, *range(len(test.excitations), len(test.excitations) + len(test.responses))]
    power, cross = np.zeros((len(f), n, n), complex), np.zeros((len(f), len(test.responses), n), complex)
    output = np.zeros((len(f), len(test.responses)))
    for _, samples in segments_of(taps, settings):
        lines = np.fft.rfft(samples[:, columns] * windows, axis=0)[chosen] * factors
        force, response = lines[:, :n], lines[:, n:]
        power += force[:, :, None] * force[:, None, :].conj()
        cross += response[:, :, None] * force[:, None, :].conj()
        output += np.abs(response) ** 2
    excitations, responses = (tuple(channel.degree_of_freedom for channel in side) for side in (forces, test.responses))
    counts = np.array([hardest.count(k) for k in hit], dtype=np.int64)
    grounded = not any(channel.high_pass_hz for channel in test.responses)
    axes = (excitations, responses, counts)
    return TapSums(test.path.name, f, power, cross, output, *axes, quantity, unit, grounded)


def _windows(settings: TapSettings, n_forces: int, n_responses: int) -> Real:
    """Return the windows of the channels, (length, n_forces + n_responses)."""
    windows = np.ones((settings.length, n_forces + n_responses))
    windows[:, :n_forces] = force_cut(settings)[:, None]
    if settings.time_constant is not None:
        windows *= exponential_window(settings.length, settings.sample_rate, settings.time_constant)[:, None]
    return windows


def force_cut(settings: TapSettings) -> Real:
    """Return the force window (length,) of the settings; ones where there is none."""
    if settings.force_samples is None:
        return np.ones(settings.length)
    return force_window(settings.length, settings.sample_rate, settings.force_samples / settings.sample_rate)


def _correction(channel: Channel, s: Complex) -> Complex:
    """Return the factor (n_lines,) that undoes a channel's delay, and a response's first-order high-pass."""
    factor = np.exp(s * (channel.input_delay_s or 0.0))
    if channel.high_pass_hz and channel.quantity != "force":
        factor = factor * before_high_pass(s, [channel.high_pass_hz])[:, 0]
    return np.asarray(factor)


def _check_places(channels: Sequence[Channel], file: str) -> None:
    names: dict[str, str] = {}
    for channel in channels:
        place = channel.degree_of_freedom
        if place in names:
            raise InputError(
                f"{file}: channels {names[place]} and {channel.name} are both at {place}; name one of them "
                "(excitations, responses), or give a table of their places (points)"
            )
        names[place] = channel.name
