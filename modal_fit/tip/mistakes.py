"""The likely mistake behind residues that disagree between cut and hammer test: unit, sign, axes, tool or pose."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from millfrf.core import Complex, InputError, Real

from ..models.modal_model import ModalModel
from ..settings import SETTINGS
from ..shapes import modal_assurance
from .agreement import SensorAgreement, agreeing, assurance_of, residues_of
from .matching import assign, shared_forces

G = 9.80665  # m/s^2
UNITS = {  # in-process over hammer residues, and the mistakes that give this factor
    1.0: "an accelerometer or a force has the wrong sign in one of the two tests",
    G: "the accelerations of the taps are in g and were called m/s^2",
    1 / G: "the accelerations of the cut are in g and were called m/s^2",
    1e3: "the forces of the cut are in kN and were called N, or those of the taps in mN",
    1e-3: "the forces of the taps are in kN and were called N, or those of the cut in mN",
}


OTHER_STRUCTURE = "another tool, another sensor position or another pose; tap the structure as it was cut"


@dataclass(frozen=True)
class Explanation:
    """A mistake that would make the two tests agree."""

    text: str
    misfit: float  # left after its correction: 1 - MAC, and the logarithm of the factors, summed over the modes


def refuse_disagreement(model: ModalModel, hammer: ModalModel, n_tip: int, agreement: SensorAgreement) -> None:
    """Refuse modes or channels that differ in shape, or in scale or sign by more than a factor of two.

    What lies beyond these limits within its errors is no disagreement; it counts in the errors of the tip.

    Raises
    ------
    InputError
        With the figures and the likely mistake.
    """
    channel = _wrong_channel(agreement)
    if agreement.agrees.all() and channel is None:
        return
    shared = shared_forces(model.excitations, hammer.excitations)
    process, tapped = residues_of(model, shared, first=True), residues_of(hammer, shared, first=False, n_tip=n_tip)
    frequencies = (model.natural_frequencies, hammer.natural_frequencies)
    explanations = [
        explanation
        for explanation in (
            _gains(process, tapped[agreement.hammer_modes], agreement),
            *_changed_axes(frequencies, process, tapped, agreement),
            _single_modes(agreement),
        )
        if explanation is not None
    ]
    mistake = min(explanations, key=lambda explanation: explanation.misfit).text if explanations else OTHER_STRUCTURE
    raise InputError(
        f"in-process and hammer residues at the sensor disagree ({_figures(agreement, channel)}): {mistake}"
    )


def _wrong_channel(agreement: SensorAgreement) -> str | None:
    """Return the figures of a response or a force that is wrong by more than a factor of two, beyond its error."""
    least, largest = SETTINGS.matched_factor
    groups = (
        (agreement.responses, agreement.response_factors, agreement.response_factor_errors),
        (agreement.forces, agreement.force_factors, agreement.force_factor_errors),
    )
    for names, factors, errors in groups:
        margin = SETTINGS.significant_change * errors
        outside = (factors.real + margin < least) | (factors.real - margin > largest)
        if outside.any():
            k = int(
                np.argmax(np.where(outside, np.abs(np.log(np.abs(factors) + 1e-300)) + np.pi * (factors.real < 0), -1))
            )
            return f"{names[k]}: factor {factors[k].real:.3g} ± {errors[k]:.2g}"
    return None


def _figures(agreement: SensorAgreement, channel: str | None) -> str:
    """Return the figures of the wrong channel, or of the mode that agrees least, and how many do not agree."""
    wrong = list(map(int, np.flatnonzero(~agreement.agrees)))
    if not wrong:
        return str(channel)
    sizes = np.maximum(np.abs(agreement.factors), 1e-300)
    r = min(wrong, key=lambda k: float(agreement.assurance[k] - np.abs(np.log(sizes[k]))))
    cut, rest = agreement.frequencies[r]
    return (
        f"{len(wrong)} of {len(agreement.factors)} modes; mode {r + 1}, {cut:.4g} Hz in the cut and {rest:.4g} Hz "
        f"tapped: MAC {agreement.assurance[r]:.2f}, factor {_number(agreement.factors[r])} ± "
        f"{agreement.factor_errors[r]:.1g}"
    )


def _number(factor: complex) -> str:
    angle = np.degrees(np.angle(factor))
    if abs(angle) < 20 or abs(angle) > 160:
        return f"{np.copysign(abs(factor), factor.real):.3g}"
    return f"{abs(factor):.3g} at {angle:.0f}°"


def _gains(process: Complex, tapped: Complex, agreement: SensorAgreement) -> Explanation | None:
    """Explain the difference by one real gain, or by one of each channel, ``A_process = a_p b_q A_hammer``.

    Gains explain it if one is beyond a factor of two, and if every mode obeys them within its errors and what
    structures change by between rest and cut.
    """
    a, b = _channel_gains(process, tapped)
    usual = float(np.median(a))
    common = _misfit(process, usual * tapped, agreement, within=SETTINGS.usual_shift)
    if common is not None and not _alike(usual, 1.0):
        return Explanation(
            f"all of them by a factor of {usual:.3g}: {_meaning(usual)}; correct it and fit again", common
        )
    misfit = _misfit(process, a[:, None] * b * tapped, agreement, within=SETTINGS.usual_shift)
    names, gains = (*agreement.responses, *agreement.forces), np.concatenate([a, b])
    wrong = [(name, gain) for name, gain in zip(names, gains, strict=True) if not _alike(gain, 1.0)]
    if misfit is None or not wrong:
        return None
    named_gains = "; ".join(f"{name} by a factor of {gain:.3g}: {_meaning(gain)}" for name, gain in wrong)
    return Explanation(f"{named_gains}; correct it and fit again", misfit)


def _channel_gains(process: Complex, tapped: Complex) -> tuple[Real, Real]:
    """Solve ``A_process = a_p b_q A_hammer`` by alternating least squares; the gains b of the forces have median 1."""
    b = np.ones(process.shape[2])
    product, size = np.real(tapped.conj() * process), np.abs(tapped) ** 2
    a = np.ones(process.shape[1])
    for _ in range(SETTINGS.gain_rounds):
        a = np.einsum("rpq,q->p", product, b) / np.maximum(np.einsum("rpq,q->p", size, b**2), 1e-300)
        b = np.einsum("rpq,p->q", product, a) / np.maximum(np.einsum("rpq,p->q", size, a**2), 1e-300)
    middle = float(np.median(b)) or 1.0
    return a * middle, b / middle


def _changed_axes(
    frequencies: tuple[Real, Real], process: Complex, tapped: Complex, agreement: SensorAgreement
) -> list[Explanation]:
    """Explain the difference by two responses or two forces that are exchanged, or by one of the wrong sign."""
    explanations = []
    for names, axis in ((agreement.responses, 1), (agreement.forces, 2)):
        whole = np.eye(len(names))
        changes = [
            (f"{name} by a factor of -1: {UNITS[1.0]}", whole - 2 * np.diag(row))
            for name, row in zip(names, whole, strict=True)
        ]
        for i, j in combinations(range(len(names)), 2):
            order = np.arange(len(names))
            order[[i, j]] = j, i
            changes.append((f"{names[i]} and {names[j]} are exchanged in one of the tests", whole[order]))
        for text, change in changes:
            changed = np.moveaxis(np.tensordot(change, tapped, axes=(1, axis)), 0, axis)
            _, chosen = assign(frequencies, (process, changed))
            misfit = _misfit(process, changed[chosen], agreement)
            if misfit is not None:
                explanations.append(Explanation(f"{text}; correct the names and fit again", misfit))
    return explanations


def _misfit(
    process: Complex, corrected: Complex, agreement: SensorAgreement, *, within: float | None = None
) -> float | None:
    """Return the misfit of all modes after a correction; None if they do not agree.

    ``within`` limits the logarithms of the factors beyond their errors; None: to a factor of two.
    """
    flat = [array.reshape(len(array), -1) for array in (process, corrected)]
    size = np.sum(np.abs(flat[1]) ** 2, axis=1)
    factors = np.sum(flat[1].conj() * flat[0], axis=1) / np.where(size > 0, size, np.inf)
    assurance, logarithms = assurance_of(process, corrected), np.abs(np.log(np.maximum(np.abs(factors), 1e-300)))
    relative = agreement.factor_errors / np.maximum(np.abs(agreement.factors), 1e-300)
    agrees = agreeing(assurance, factors, agreement.assurance_errors, relative * np.abs(factors))
    if within is not None:
        agrees &= logarithms <= within + SETTINGS.significant_change * relative
    return float(np.sum(1 - assurance + logarithms)) if agrees.all() else None


def _alike(gain: float, other: float) -> bool:
    least, largest = SETTINGS.matched_factor
    return least <= gain / other <= largest


def _meaning(gain: float) -> str:
    size = max(abs(gain), 1e-300)
    unit = min(UNITS, key=lambda factor: abs(np.log(factor / size)))
    if abs(np.log(unit / size)) > SETTINGS.usual_shift or (unit == 1.0 and gain > 0):
        return "a sensitivity, or another sensor or tool"
    sign = f", and {UNITS[1.0]}" if gain < 0 and unit != 1.0 else ""
    return f"{UNITS[unit]}{sign}"


def _single_modes(agreement: SensorAgreement) -> Explanation | None:
    """Explain the difference by the fewer modes that differ, where most agree; each costs as much as a MAC of 0."""
    wrong, others = np.flatnonzero(~agreement.agrees), np.flatnonzero(agreement.agrees)
    if not len(wrong) or len(wrong) > len(others):
        return None
    misfit = np.sum(1 - agreement.assurance[others] + np.abs(np.log(np.abs(agreement.factors[others]))))
    numbers = ", ".join(str(r + 1) for r in wrong)
    cause = (
        "the taps hardly show it; tap harder, along the direction in which it moves, or more often"
        if (agreement.factor_errors[wrong] > 1).all()  # more than the factor of equal tests
        else "the cut hardly excited it, a close mode was fitted with it, or tool, clamping or pose was another; leave "
        "it out of the fit (--modes, or a narrower --band), or tap again as it was cut"
    )
    return Explanation(f"mode {numbers} differs alone: {cause}", len(wrong) + float(misfit))


def refuse_tip_scale(tip: Complex, sensor: Complex, names: Sequence[str], frequencies: Real) -> None:
    """Refuse a tip that moves far less or far more than the sensor on the same spindle in all modes, or against it.

    Tip and sensor sit on one rigid spindle that turns about joints at least twice as far away as the tip is from the
    sensor. Their motions then differ by less than half of the motion, in the whole and in each direction. A ratio
    nearer to g or 1/g than to 1 (beyond ``sqrt(g)``), or a negative one, is a mistake: in the geometric mean over the
    modes, or in one direction with a difference of more than half of the largest motion and one ratio in all modes.

    Parameters
    ----------
    tip, sensor : (n_modes, n_directions)
        Shapes of the matched hammer modes at the tip and at the sensor, of common scale.
    names
        Responses at the tip.
    frequencies : (n_modes,), Hz
        Natural frequencies of these modes, for the message.

    Raises
    ------
    InputError
        With the ratios and the likely mistake.
    """
    sizes = np.linalg.norm(tip, axis=1), np.linalg.norm(sensor, axis=1)
    ratio = sizes[0] / np.maximum(sizes[1], 1e-300)
    listed = ", ".join(f"{r:.3g} at {f:.4g} Hz" for r, f in zip(ratio, frequencies, strict=True))
    _refuse_ratio(float(np.exp(np.mean(np.log(np.maximum(ratio, 1e-300))))), "the tip", f" ({listed})")
    along = np.real(np.sum(sensor.conj() * tip, axis=1)) / np.maximum(sizes[0] * sizes[1], 1e-300)
    if (along < -SETTINGS.opposite_motion).all():
        listed = ", ".join(f"{c:.2f} at {f:.4g} Hz" for c, f in zip(along, frequencies, strict=True))
        raise InputError(
            f"the tip moves against the sensor on the same spindle in every mode (correlation {listed}): an "
            "accelerometer or the force of one of the two FRFs has the wrong sign; turn its direction"
        )
    moved, seen = (shapes / np.maximum(sizes[1], 1e-300)[:, None] for shapes in (tip, sensor))
    power, tip_power = np.sum(np.abs(seen) ** 2, axis=0), np.sum(np.abs(moved) ** 2, axis=0)
    product = np.real(np.sum(seen.conj() * moved, axis=0))
    # a turn about a joint moves the tip more than the sensor: the largest motion may be the tip's
    differs = np.sum(np.abs(moved - seen) ** 2, axis=0) > 0.25 * max(power.max(), tip_power.max())
    for p in map(int, np.flatnonzero(differs & (power > 0))):
        if product[p] < -SETTINGS.opposite_motion * np.sqrt(power[p] * tip_power[p]):
            raise InputError(
                f"{names[p]} moves against the sensor on the same spindle over all modes: this accelerometer or that "
                "of the sensor has the wrong sign; turn its direction"
            )
        # a unit has one factor for all modes; a joint near the sensor moves it little in some of them only
        if product[p] ** 2 > SETTINGS.matched_assurance * power[p] * tip_power[p]:
            _refuse_ratio(float(np.sqrt(tip_power[p] / power[p])), names[p], " over all modes")


def _refuse_ratio(ratio: float, place: str, figures: str) -> None:
    if 1 / np.sqrt(G) <= ratio <= np.sqrt(G):
        return
    meanings = {
        G: "were the accelerations at the sensor in g, or multiplied by 9.81 twice at the tip?",
        1 / G: "were the accelerations at the tip in g and called m/s^2?",
        1e3: "is the tip's FRF in mm/N, or were its forces in kN?",
        1e-3: "is the sensor's FRF in mm/N, or were its forces in kN?",
    }
    nearest = min(meanings, key=lambda factor: abs(np.log(max(ratio, 1e-300) / factor)))
    raise InputError(
        f"{place} moves {ratio:.3g} times as much as the sensor on the same spindle{figures}: {meanings[nearest]} "
        "Correct the unit of that FRF"
    )


def refuse_exchanged_tip(right: Complex, left: Complex, names: Sequence[str], frequencies: Real) -> None:
    """Refuse responses at the tip that are exchanged: the exchange, and only it, makes the modes reciprocal.

    Right and left vector of a mode of a reciprocal structure are parallel where it is excited and measured. The mean
    MAC of both must be below, and that of the exchanged axes above the limit from which shapes are the same.

    Parameters
    ----------
    right, left : (n_modes, n_points)
        Right and left vectors of the hammer modes at the drive points of the tip.
    names
        Names of the responses there.
    frequencies : (n_modes,), Hz
        Natural frequencies, for the message.

    Raises
    ------
    InputError
        Two exchanged axes.
    """
    own = _mean_assurance(right, left)
    if len(names) < 2 or own >= SETTINGS.matched_assurance:
        return
    for i, j in combinations(range(len(names)), 2):
        order = np.arange(len(names))
        order[[i, j]] = j, i
        exchanged = _mean_assurance(right[:, order], left)
        if exchanged >= SETTINGS.matched_assurance:
            raise InputError(
                f"{names[i]} and {names[j]} of the tip's FRF are exchanged: right and left vectors of its modes at "
                f"{', '.join(f'{f:.4g}' for f in frequencies)} Hz are parallel with a mean MAC of {own:.2f}, and of "
                f"{exchanged:.2f} if these two axes change places; correct their names"
            )


def _mean_assurance(right: Complex, left: Complex) -> float:
    return float(np.mean(np.diag(modal_assurance(right, left))))
