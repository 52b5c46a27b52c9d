"""A `Trial`: one recording, reduced to the channels and the band that a model speaks of."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.signal import detrend, resample_poly

from acquisition import Channel, Recording, Stream, aligned_samples
from foundation import DegreeOfFreedom, InputError
from modal_fit import ModalModel

from .compared_band import compared_band, reach_of

Real = NDArray[np.float64]

POWERS = {"displacement": 0, "velocity": 1, "acceleration": 2}
"""Times that a receptance is differentiated to give the quantity."""

SHORTEST = 20.0
"""A trial lasts at least so many periods of the lowest mode."""


@dataclass(frozen=True)
class Trial:
    """Forces and responses of one recording in the order of a model's degrees of freedom.

    Parameters
    ----------
    name
        Of the recording.
    rate
        Hz.
    force : (n_samples, n_excitations), N
    response : (n_samples, n_responses)
        In SI units of each response's quantity.
    powers : (n_responses,)
        0 displacement, 1 velocity, 2 acceleration.
    channels
        Names of the excitation channels, then of the response channels.
    corners
        Of each response's known first-order high-pass, Hz; 0: none. Empty: none of them has one.
    """

    name: str
    rate: float
    force: Real
    response: Real
    powers: NDArray[np.int64]
    channels: tuple[str, ...]
    corners: tuple[float, ...] = ()

    def kinematic(self, frequencies: Real) -> NDArray[np.complex128]:
        """Factor from displacement to each measured quantity, ``(i w)^power i w / (i w + w_corner)``.

        Parameters
        ----------
        frequencies : (n,), Hz

        Returns
        -------
        (n, n_responses)
        """
        s = 2j * np.pi * np.asarray(frequencies, dtype=float)[:, None]
        factor = s**self.powers
        for column, corner in enumerate(self.corners):
            if corner > 0:
                factor[:, column] *= s[:, 0] / (s[:, 0] + 2 * np.pi * corner)
        return np.asarray(factor)

    @property
    def duration(self) -> float:
        """s."""
        return len(self.force) / self.rate

    @property
    def level(self) -> float:
        """Root mean square of the force, all directions together, N."""
        return float(np.sqrt(np.mean(np.sum((self.force - self.force.mean(axis=0)) ** 2, axis=1))))


def band_of(model: ModalModel, rate: float) -> tuple[float, float]:
    """Band (Hz) in which a model and a recording are compared: both edges of :func:`compared_band`.

    Raises
    ------
    InputError
        The recording is sampled too slowly for the model.
    """
    return compared_band(model, rate).edges


def read_trial(path: str | os.PathLike[str], model: ModalModel, *, stream: str | None = None) -> Trial:
    """Read one recording for a model of receptances; sampled far above the band, it is brought down.

    Parameters
    ----------
    path
        Recording with a force channel at each of the model's excitations and a displacement, velocity or acceleration
        at each of its responses.
    model
        What will be compared.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        A channel is missing, values are not finite, or the record is too short or sampled too slowly.
    """
    with Recording(path) as recording:
        source = recording.stream(stream)
        forces, force_signs = _matched(source, model.excitations, ("force", "voltage"))
        responses, response_signs = _matched(source, model.responses, tuple(POWERS))
        names = tuple(channel.name for channel in (*forces, *responses))
        samples = aligned_samples(source, names) * np.array(force_signs + response_signs)
        rate = source.sample_rate
    bad = ~np.isfinite(samples).all(axis=0)
    if bad.any():
        name = names[int(np.argmax(bad))]
        raise InputError(f"{Path(path).name}: channel {name} holds values that are not finite; cut them out first")
    # what lies above the model's band stays: tones are looked for there, and doubts
    needed = 6.0 * max(reach_of(model, rate)[1], band_of(model, rate)[1])
    if rate > 1.5 * needed:
        ratio = Fraction(needed / rate).limit_denominator(200)
        samples = resample_poly(samples, ratio.numerator, ratio.denominator, axis=0)
        rate *= float(ratio)
    if len(samples) / rate < SHORTEST / float(model.natural_frequencies.min()):
        raise InputError(
            f"{Path(path).name} lasts {len(samples) / rate:.3g} s; {SHORTEST:g} periods of the lowest mode, "
            f"{SHORTEST / float(model.natural_frequencies.min()):.3g} s, are the least"
        )
    powers = np.array([POWERS[channel.quantity] for channel in responses])
    count = len(forces)
    corners = tuple(channel.high_pass_hz or 0.0 for channel in responses)
    force = _without_high_pass(samples[:, :count], rate, [channel.high_pass_hz or 0.0 for channel in forces])
    return Trial(Path(path).stem, rate, force, samples[:, count:], powers, names, corners)


def _without_high_pass(force: Real, rate: float, corners: Sequence[float]) -> Real:
    """Forces (n_samples, n) before their channels' known first-order high-passes, ``f + w_corner int f dt``.

    The straight drift that the integral leaves lies below every band and is taken out.
    """
    whole = force.copy()
    for column, corner in enumerate(corners):
        if corner > 0:
            seen = force[:, column] - force[:, column].mean()
            whole[:, column] += detrend(2 * np.pi * corner * cumulative_trapezoid(seen, dx=1 / rate, initial=0.0))
    return whole


def measured_part(
    model: ModalModel, paths: Sequence[str | os.PathLike[str]], *, stream: str | None = None
) -> ModalModel:
    """The model with the responses that every recording has; a sensor that was not mounted is no obstacle.

    Raises
    ------
    InputError
        No response of the model is in all recordings.
    """
    rows = list(range(len(model.responses)))
    for path in paths:
        with Recording(path) as recording:
            source = recording.stream(stream)
            rows = [k for k in rows if _channel_at(source, model.responses[k], tuple(POWERS)) is not None]
    if not rows:
        raise InputError(
            f"no displacement, velocity or acceleration at {', '.join(model.responses)} is in every recording; "
            "give recordings of the model's degrees of freedom"
        )
    if len(rows) == len(model.responses):
        return model
    residuals = model.residuals
    if residuals is not None:
        kept = None if residuals.residues is None else residuals.residues[:, rows]
        residuals = replace(residuals, upper=residuals.upper[rows], lower=residuals.lower[rows], residues=kept)
    labels = tuple(model.responses[k] for k in rows)
    return replace(model, right=model.right[:, rows], responses=labels, residuals=residuals, covariance=None)


def read_trials(
    paths: Sequence[str | os.PathLike[str]], model: ModalModel, *, stream: str | None = None
) -> list[Trial]:
    """Read recordings, weakest force first.

    Raises
    ------
    InputError
        No recording, or what :func:`read_trial` refuses.
    """
    if not paths:
        raise InputError("no recording given; name one or more")
    if model.quantity != "receptance":
        raise InputError(
            f"a diagnosis needs a model of receptances, this is one of {model.quantity}; calibrate it first"
        )
    return sorted((read_trial(path, model, stream=stream) for path in paths), key=lambda trial: trial.level)


def _matched(stream: Stream, wanted: Sequence[str], quantities: tuple[str, ...]) -> tuple[list[Channel], list[float]]:
    """The channel at each degree of freedom, and the sign that turns its direction into the wanted one."""
    chosen, signs = [], []
    for label in wanted:
        found = _channel_at(stream, label, quantities)
        if found is None:
            there = ", ".join(
                f"{channel.name} ({channel.quantity} {channel.degree_of_freedom})" for channel in stream.channels
            )
            raise InputError(
                f"{stream.path.name}: no {' or '.join(quantities)} at {label}, which the model speaks of; "
                f"it has {there}"
            )
        chosen.append(found[0])
        signs.append(found[1])
    return chosen, signs


def _channel_at(stream: Stream, label: str, quantities: tuple[str, ...]) -> tuple[Channel, float] | None:
    """The first channel of those quantities at a degree of freedom, and its sign; None where there is none."""
    aim = DegreeOfFreedom.parse(label)
    for channel in stream.channels:
        if channel.quantity in quantities and channel.node:
            here = DegreeOfFreedom(channel.node, channel.direction)
            if (here.node, here.axis) == (aim.node, aim.axis):
                return channel, here.sign * aim.sign
    return None
