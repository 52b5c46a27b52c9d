"""Exchanged or reversed channels, and clocks of forces and responses that run at different rates."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, permutations, product
from typing import Any

import numpy as np
import scipy

from estimation import BandRecording, WindowedSpectrum
from millfrf.core import Complex, Index, Real

from ..inference.diagnosis import AcceptedCause
from ..inference.settings import EvidenceSettings, Settings
from ..models.first_motion import predict_lines
from ..models.fitting import Fit, fit
from ..models.hypothesis import Hypothesis
from ..models.linear_lines import linear_lines
from ..models.misfit import fitted_noise, through_structure
from ..physics.recording_faults import CLOCK_SKEW, REVERSED_CHANNEL, SWAPPED_CHANNELS, delayed
from ..records.noise_model import NoiseModel, whitening

FITTED = 3  # most wirings to which the modal parameters are fitted
WHOLE_GROUP = 3  # number of channels up to which all wirings are tried; beyond, one exchange or reversal at a time

ROUNDS = 6  # most rounds of estimate and correction
PARTS = 3  # parts of the band in which the skew must be the same, with equal information
SAME = 1e-3  # probability of the scatter between parts below which their skews differ
STEPS = 8  # most steps of a fit after a correction


@dataclass(frozen=True)
class Side:
    """Channels of one side, forces or responses: which recorded channel is at each place, and with which sign."""

    recorded: Index  # (n,); index of the recorded channel that belongs at each place
    signs: Real  # (n,); sign of that channel

    @property
    def right(self) -> bool:
        """Whether the channels are as they were recorded."""
        return bool((self.recorded == np.arange(len(self.recorded))).all() and (self.signs > 0).all())

    @property
    def cycles(self) -> tuple[tuple[int, ...], ...]:
        """Places whose channels are exchanged: each has the channel of the next one, the last that of the first."""
        cycles, seen = list[tuple[int, ...]](), set[int]()
        for first in range(len(self.recorded)):
            cycle, place = list[int](), first
            while place not in seen:
                seen.add(place)
                cycle.append(place)
                place = int(self.recorded[place])
            cycles += [tuple(cycle)] if len(cycle) > 1 else []
        return tuple(cycles)

    @property
    def changed(self) -> int:
        """Number of exchanges and reversals."""
        return sum(len(cycle) - 1 for cycle in self.cycles) + int((self.signs < 0).sum())

    def corrected(self, columns: Any) -> Any:
        """Return the recorded columns (..., n) in their places."""
        return columns[..., self.recorded] * self.signs

    @property
    def inverse(self) -> "Side":
        """The places at which the recorded channels are."""
        order = np.argsort(self.recorded)
        return Side(order, self.signs[order])


@dataclass(frozen=True)
class Wiring:
    """Forces and responses of a recording, each exchanged and reversed."""

    forces: Side
    responses: Side

    @property
    def right(self) -> bool:
        """Whether nothing is exchanged or reversed."""
        return self.forces.right and self.responses.right

    @property
    def changed(self) -> int:
        """Number of exchanges and reversals."""
        return self.forces.changed + self.responses.changed

    def recording(self, recording: BandRecording) -> BandRecording:
        """Return a recording with its channels in their places."""
        sides = (recording.excitations, self.forces), (recording.responses, self.responses)
        excitations, responses = (tuple(channels[k] for k in side.recorded) for channels, side in sides)
        return replace(
            recording,
            force=self.forces.corrected(recording.force),
            response=self.responses.corrected(recording.response),
            excitations=excitations,
            responses=responses,
            rounding=None if recording.rounding is None else recording.rounding[self.responses.recorded],
        )

    def lines(self, lines: WindowedSpectrum) -> WindowedSpectrum:
        """Return the spectra of a recording, without their measured noise, with the channels in their places."""
        return replace(
            lines,
            recording=self.recording(lines.recording),
            force_lines=self.forces.corrected(lines.force_lines),
            force_here=self.forces.corrected(lines.force_here),
            measured=self.responses.corrected(lines.measured),
            noise=None,
        )

    @property
    def inverse(self) -> "Wiring":
        """The wiring that returns channels from their places to the recorded order."""
        return Wiring(self.forces.inverse, self.responses.inverse)

    def causes(self, recording: BandRecording, evidence: float) -> tuple[AcceptedCause, ...]:
        """Return the causes that name each exchange and each reversal of a recording's channels."""
        causes = list[AcceptedCause]()
        for side, channels in (self.forces, recording.excitations), (self.responses, recording.responses):
            names = [channel.name for channel in channels]
            places: list[dict[str, Any]] = [{"channels": [names[k] for k in cycle]} for cycle in side.cycles]
            causes += [AcceptedCause(SWAPPED_CHANNELS.name, place, {}, {}, evidence) for place in places]
            reversed_names = [names[k] for k, sign in zip(side.recorded, side.signs, strict=True) if sign < 0]
            causes += [
                AcceptedCause(REVERSED_CHANNEL.name, {"channel": name}, {}, {}, evidence) for name in reversed_names
            ]
        return tuple(causes)


def stated_wiring(recording: BandRecording, terms: Sequence[Mapping[str, Any]]) -> Wiring:
    """Return the wiring that terms ``{name, location}`` of a model state for a recording; others are left out."""
    sides = []
    for channels in (recording.excitations, recording.responses):
        names = [channel.name for channel in channels]
        order, signs = np.arange(len(names)), np.ones(len(names))
        for term in terms:
            location = term["location"]
            if term["name"] == SWAPPED_CHANNELS.name and set(location["channels"]) <= set(names):
                cycle = [names.index(name) for name in location["channels"]]
                for place, following in pairwise([*cycle, cycle[0]]):
                    order[place] = following
            elif term["name"] == REVERSED_CHANNEL.name and location["channel"] in names:
                signs[names.index(location["channel"])] = -1.0
        sides.append(Side(order, signs[order]))
    return Wiring(*sides)


def find_wiring(
    lines: list[WindowedSpectrum], nominal: Hypothesis, settings: EvidenceSettings, steps: int
) -> tuple[Wiring | None, float]:
    """Find exchanged or reversed channels: the wiring and its evidence; None and 0 for the stated wiring.

    Wirings are ranked by how well the nominal model predicts the recordings. The modal parameters are fitted with the
    best of those that surpass the stated wiring. One is accepted if its score exceeds that of the stated wiring by
    ``settings.least`` and twice the logarithm of the number of wirings with as many changes, and if its modes are
    nearer to the nominal ones.

    Parameters
    ----------
    lines
        Spectra of the recordings, wired as stated.
    nominal
        Nominal model.
    settings
        Evidence that a cause needs.
    steps
        Most steps of a fit.
    """
    best, evidence = None, 0.0
    if ranked := _ranked(lines, nominal):
        stated = fit(lines, nominal, iterations=steps)
        for wiring, alternatives in ranked[:FITTED]:
            wired = fit([wiring.lines(each) for each in lines], nominal, iterations=steps)
            gain = stated.score - wired.score - 2 * float(np.log(alternatives))
            if gain > max(settings.least, evidence) and wired.deviation < stated.deviation:
                best, evidence = wiring, gain
    return best, evidence


def _ranked(lines: list[WindowedSpectrum], nominal: Hypothesis) -> list[tuple[Wiring, int]]:
    """Return the wirings with which the nominal model predicts better than with the stated one, best first.

    Each comes with the number of wirings that have as many changes. Reversing all forces is the same as reversing all
    responses: the form with fewer changes is kept.
    """
    through = [linear_lines(nominal, each).through for each in lines]
    recording, likeliest = lines[0].recording, dict[float, Wiring]()
    counts = Counter[int]()
    for forces in _sides([channel.quantity for channel in recording.excitations]):
        costs = _cost_of_channels(lines, through, forces)
        for responses in _sides([channel.quantity for channel in recording.responses]):
            wiring = Wiring(forces, responses)
            parts = zip(costs, responses.recorded, responses.signs < 0, strict=True)
            cost = round(sum(float(of_place[recorded, int(turned)]) for of_place, recorded, turned in parts), 6)
            counts[wiring.changed] += 1
            if cost not in likeliest or wiring.changed < likeliest[cost].changed:
                likeliest[cost] = wiring
    stated = next(cost for cost, wiring in likeliest.items() if wiring.right)
    return [(likeliest[cost], counts[likeliest[cost].changed]) for cost in sorted(likeliest) if cost < stated]


def _cost_of_channels(lines: list[WindowedSpectrum], through: list[Complex], forces: Side) -> Real:
    """Return twice the negative log likelihood of each recorded response at each place, as it is and reversed.

    The noise of each channel is white with unknown variance. The result has the shape (n_places, n_recorded, 2).
    """
    n = lines[0].measured.shape[1]
    power, common, count = np.zeros((n, n)), np.zeros((n, n)), 0
    for each, matrix in zip(lines, through, strict=True):
        predicted = np.einsum("kpq,kq->kp", matrix, forces.corrected(each.force_here))
        power += np.add.outer(*((np.abs(side) ** 2).sum(axis=0) for side in (predicted, each.measured)))
        common += (predicted.T @ each.measured.conj()).real
        count += 2 * len(each.frequencies)
    residual = np.stack([power - 2 * common, power + 2 * common], axis=2)
    return np.asarray(count * np.log(np.maximum(residual, np.finfo(float).tiny)))


def _sides(quantities: Sequence[str]) -> Iterator[Side]:
    """Yield the ways in which channels may be exchanged with others of their quantity, and reversed."""
    n = len(quantities)
    stated: Index = np.arange(n)
    if n <= WHOLE_GROUP:
        for order, signs in product(permutations(range(n)), product((1.0, -1.0), repeat=n)):
            if all(quantities[place] == quantities[other] for place, other in enumerate(order)):
                yield Side(np.array(order), np.array(signs))
        return
    yield Side(stated, np.ones(n))
    for place in range(n):
        yield Side(stated, np.where(stated == place, -1.0, 1.0))
    for first, second in combinations(range(n), 2):
        if quantities[first] == quantities[second]:
            exchanged = stated.copy()
            exchanged[[first, second]] = second, first
            yield Side(exchanged, np.ones(n))


@dataclass(frozen=True)
class Skew:
    """Rate error of the responses' clock, from parts of the band of each recording.

    A part with a single line cannot tell the skew from a delay: its error is infinite.
    """

    values: Real  # (n_recordings, PARTS); delay of the responses per time
    errors: Real  # standard errors

    @property
    def mean(self) -> float:
        """Weighted mean of all parts."""
        return float(np.sum(self.values / self.errors**2) / np.sum(self.errors**-2.0))

    @property
    def error(self) -> float:
        """Standard error of the mean."""
        return float(np.sum(self.errors**-2.0) ** -0.5)

    @property
    def chance(self) -> float:
        """Probability that equal skews scatter as much between the parts; 0 if there are no two parts."""
        known = np.isfinite(self.errors)
        if known.sum() < 2:
            return 0.0
        scatter = float(np.sum(((self.values - self.mean) / self.errors)[known] ** 2))
        return float(scipy.stats.chi2.sf(scatter, known.sum() - 1))


def correct_skew(
    lines: list[WindowedSpectrum], base: Fit, settings: Settings
) -> tuple[list[WindowedSpectrum], Fit, tuple[AcceptedCause, ...]]:
    """Correct the clock of the responses if it runs at another rate than that of the forces.

    With the prediction x, the residual of a small skew e and delay d is ``-(d + e t) x'(t)``. A skew delays all
    channels of all recordings alike, at all frequencies, whereas a structure that changes during the cut delays its
    own modes: the skews of parts of the bands must agree.

    Parameters
    ----------
    lines
        Spectra of the recordings.
    base
        Fit of the modal parameters to them.
    settings
        Evidence that a cause needs, and the significance level of the comparison.

    Returns
    -------
    tuple
        Corrected recordings, the fit to them, and the skew as a cause; unchanged and empty if there is none.
    """
    total, fitted, corrected = 0.0, base, lines
    for _ in range(ROUNDS):
        skew = estimated_skew(corrected, fitted)
        if not np.isfinite(skew.errors).any():
            return lines, base, ()
        if not total and (skew.mean / skew.error) ** 2 < settings.evidence.least:
            return lines, base, ()
        if total and abs(skew.mean) < skew.error:
            break
        total += skew.mean
        corrected = [_corrected(recording, total) for recording in lines]
        fitted = fit(corrected, fitted.hypothesis, iterations=STEPS)
    # the steps of the modes that the corrections brought with them are no evidence for a skew
    evidence = min(base.score, fit(lines, fitted.hypothesis, iterations=STEPS).score) - fitted.score
    if min(evidence, (total / skew.error) ** 2) < settings.evidence.least or skew.chance < SAME:
        return lines, base, ()
    cause = AcceptedCause(CLOCK_SKEW.name, {}, {"rate_error": total}, {"rate_error": skew.error}, evidence)
    return corrected, fitted, (cause,)


def estimated_skew(lines: list[WindowedSpectrum], fitted: Fit) -> Skew:
    """Estimate the skew in parts of the band of each recording, each with a delay of its own."""
    rows = [_of_recording(fitted, recording, noise) for recording, noise in zip(lines, fitted.noises, strict=True)]
    return Skew(*(np.array(part) for part in zip(*rows, strict=True)))


def _of_recording(fitted: Fit, lines: WindowedSpectrum, noise: NoiseModel) -> tuple[Real, Real]:
    """Return the skew in each part of the band of one recording, and its standard error, each (PARTS,)."""
    predicted = predict_lines(fitted.hypothesis, lines)
    velocity = lines.signal(predicted.spectrum * (2j * np.pi * lines.padded_frequencies)[:, None])
    time = lines.recording.start + np.arange(len(velocity)) / lines.recording.rate
    white = whitening(fitted_noise(lines, through_structure(fitted.hypothesis, lines), noise))

    def columns(signal: Complex) -> Complex:
        return np.asarray(np.einsum("kij,kj->ki", white, signal))

    grown, delay = (columns(lines.cut(-signal)) for signal in (velocity * time[:, None], velocity))
    residual = columns(lines.measured - predicted.response)
    information = np.cumsum(np.sum(np.abs(grown) ** 2, axis=1))
    edges = np.searchsorted(information, information[-1] * np.arange(1, PARTS) / PARTS)
    values, errors = np.zeros(PARTS), np.full(PARTS, np.inf)
    for k, part in enumerate(np.split(np.arange(len(grown)), edges)):
        if len(part) < 2:
            continue
        design = np.stack([grown[part].ravel(), delay[part].ravel()], axis=1)
        normal = np.linalg.inv((design.conj().T @ design).real)
        values[k] = normal[0] @ (design.conj().T @ residual[part].ravel()).real
        errors[k] = np.sqrt(normal[0, 0] / 2)
    return values, errors


def _corrected(lines: WindowedSpectrum, skew: float) -> WindowedSpectrum:
    """Return a recording whose responses have the clock of the forces."""
    recording = lines.recording
    response = delayed(recording.response, recording, -skew)
    return replace(lines, recording=replace(recording, response=response), measured=lines.cut(response))
