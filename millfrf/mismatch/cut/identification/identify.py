"""Force coefficients, runout and their errors from cuts at several feeds, with a check of axes, teeth and zero."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import InputError, Real
from millfrf.core.results import Result
from millfrf.cutting import MillingProcess

from .coefficient_fit import LEAST_LEFT_OUT, CoefficientFit, fit_cuts, fit_mean_forces
from .cut_forces import CutForces
from .placements import CHANCE, other_teeth, parsed_placement, require_placement
from .ringing import Ringing, find_ringing, moved_modes, with_modes

COEFFICIENT_SYMBOLS = ("Ktc", "Krc", "Kac", "Kte", "Kre", "Kae")
EXPLAINED = 0.1  # largest misfit of waveforms whose coefficients are used: what the model lacks biases them as much
BEYOND_ERRORS = 3.0  # standard errors by which two estimates of one coefficient may differ


@dataclass(frozen=True)
class CutCoefficients(Result):
    """Force coefficients of a cutter in a material.

    Parameters
    ----------
    process
        Cutter and engagement of the first cut with the identified coefficients, their errors and the runout.
    method
        ``waveforms``: all spindle orders of the forces; ``mean forces``: their means over the revolutions alone.
    coefficients, errors : (6,), Pa and N/m
        ``Ktc, Krc, Kac, Kte, Kre, Kae`` and their standard errors; NaN where no measured axis shows one.
    mean_coefficients, mean_errors : (6,), Pa and N/m
        From the mean forces; NaN where these do not separate them.
    fit
        Fit of the waveforms.
    cuts
        Forces of the cuts.
    warnings
        Sentences on what makes the coefficients doubtful.
    ringing
        Modes of the dynamometer that were inferred from the forces; None: the forces are explained without, or its
        transfer was measured.
    """

    process: MillingProcess
    method: str
    coefficients: Real
    errors: Real
    mean_coefficients: Real
    mean_errors: Real
    fit: CoefficientFit
    cuts: tuple[CutForces, ...]
    warnings: tuple[str, ...]
    ringing: Ringing | None = None


def identify_coefficients(
    cuts: Sequence[CutForces], channels: Sequence[str], axes: Sequence[str] = ()
) -> CutCoefficients:
    """Identify force coefficients from the forces of cuts.

    The forces of all cuts are those of a rigid tool with one set of six coefficients and one runout,

    ``F = sum_j int T(phi_j) (K_c h_j + K_e / sin(gamma)) dz``,

    whose spindle orders are compared with the measured ones (Altintas, Manufacturing Automation, 2nd ed., sections 2.7
    and 2.8). The mean forces, which no resonance of the dynamometer changes, are a second witness: where the waveforms
    are not explained to 10 %, the coefficients of the means are used, and half of the difference is added to their
    errors.

    Parameters
    ----------
    cuts
        Forces of at least one cut, best of three or more feeds.
    channels
        Names of the forces, for messages.
    axes
        Measured direction along X, Y and Z of the cut, such as ``+Y, +X, -Z``; empty: as the channels state.

    Raises
    ------
    InputError
        The cuts do not separate the coefficients, or the forces fit with other axes or another number of teeth only.
    """
    placement = parsed_placement(axes or ("+X", "+Y", "+Z"), cuts[0].axes)
    cuts = [placement.of(cut) for cut in cuts]
    fit = fit_cuts(cuts)
    ringing = None
    try:
        means, covariance = fit_mean_forces(cuts)
    except InputError:  # a single feed: the waveforms alone tell cutting from edge forces
        means, covariance = np.full(6, np.nan), np.full((6, 6), np.nan)
    else:
        require_placement(cuts, fit, placement, channels)
        _require_teeth(cuts, fit)
        if fit.misfit > EXPLAINED and len(cuts) >= LEAST_LEFT_OUT and cuts[0].transfer is None:
            ringing = find_ringing(cuts, fit)
            if ringing.explains(EXPLAINED):
                cuts = with_modes(cuts, ringing.modes)
                fit = fit_cuts(cuts, moved_modes(cuts, ringing.modes))
    mean_errors = np.sqrt(np.diag(covariance))
    errors = np.sqrt(np.diag(fit.covariance))
    by_waveforms = fit.misfit <= EXPLAINED or bool(np.isnan(means).all())
    if by_waveforms:
        coefficients, covariance = fit.coefficients, fit.covariance
    else:
        bias = (fit.coefficients - means) / 2
        coefficients, covariance = means, covariance + np.outer(bias, bias)
        errors = np.hypot(mean_errors, np.abs(bias))
    return CutCoefficients(
        _process(cuts, coefficients, covariance, fit),
        "waveforms" if by_waveforms else "mean forces",
        coefficients,
        errors,
        means,
        mean_errors,
        fit,
        tuple(cuts),
        (
            *(doubt for cut in cuts for doubt in cut.doubts),
            *([] if ringing is None else _ringing_in_words(ringing, cuts)),
            *_doubts(cuts, fit, means, mean_errors, by_waveforms),
            *_negative_edges(coefficients),
        ),
        ringing,
    )


def _require_teeth(cuts: Sequence[CutForces], fit: CoefficientFit) -> None:
    stated = cuts[0].process.teeth
    teeth = other_teeth(cuts, fit)
    if teeth is not None:
        raise InputError(
            f"the forces repeat as those of {teeth} teeth, not of the {stated} of the cutting file, or the spindle "
            f"turns {stated / teeth:.3g} times as fast as stated; correct teeth and feed_per_tooth_m, or the speed"
        )


def is_runout_determined(fit: CoefficientFit) -> bool:
    """Return whether the waveforms are explained, and their runout is no chance."""
    return fit.misfit <= EXPLAINED and fit.runout_chance < CHANCE


def _process(cuts: Sequence[CutForces], coefficients: Real, covariance: Real, fit: CoefficientFit) -> MillingProcess:
    """Return the process of the first cut with the identified coefficients; shares have errors of the first order."""
    first = cuts[0].process
    _require_determined(float(coefficients[0]), math.sqrt(float(covariance[0, 0])))
    tangential = float(coefficients[0])
    known = np.isfinite(coefficients)
    by_share = np.diag(np.where(known, 1.0, 0.0))  # derivative of the file's numbers by the coefficients
    values = np.where(known, coefficients, 0.0)
    for k, share in ((1, first.krc), (2, first.kac)):
        if known[k]:
            share = values[k] / tangential
            by_share[k, k], by_share[k, 0] = 1 / tangential, -share / tangential
        values[k] = share
    errors = by_share @ np.where(np.outer(known, known), covariance, 0.0) @ by_share.T
    for k, error in ((1, first.krc_std), (2, first.kac_std)):
        if not known[k]:
            errors[k, k] = error**2
    edges = np.maximum(values[3:], 0.0)
    deviations = np.sqrt(np.diag(errors)[:3])
    return replace(
        first,
        ktc=tangential, krc=float(values[1]), kac=float(values[2]),
        kte=float(edges[0]), kre=float(edges[1]), kae=float(edges[2]),
        runout=math.hypot(*fit.runout) if is_runout_determined(fit) else 0.0,
        ktc_std=float(deviations[0]), krc_std=float(deviations[1]), kac_std=float(deviations[2]),
        covariance=tuple(tuple(float(value) for value in row) for row in (errors + errors.T) / 2),
    )  # fmt: skip


def _require_determined(tangential: float, deviation: float) -> None:
    if not tangential > 0:
        raise InputError(
            f"the tangential coefficient comes out as {tangential / 1e6:.4g} MPa; check the feeds, which are per tooth "
            "and in metres, the depth and the unit of the forces"
        )
    if deviation >= tangential:
        raise InputError(
            f"the tangential coefficient, {tangential / 1e6:.4g} MPa, has a standard error of {deviation / 1e6:.4g} "
            "MPa: these cuts do not determine it; cut at three or more feeds, or compare lower frequencies (--highest)"
        )


def _doubts(
    cuts: Sequence[CutForces], fit: CoefficientFit, means: Real, mean_errors: Real, by_waveforms: bool
) -> list[str]:
    doubts = []
    if np.isnan(means).all():
        doubts.append("the feeds are alike: axes, signs and teeth are not checked; give cuts at three or more feeds")
    if fit.misfit > EXPLAINED:
        used = (
            "the coefficients may be wrong by as much"
            if by_waveforms
            else "the coefficients are those of the mean forces, and their errors include half of the difference"
        )
        doubts.append(
            f"{100 * fit.misfit:.0f} % of the waveforms is not explained: a resonance of the dynamometer or the tool, "
            f"another engagement or chatter lies in them; {used}"
        )
    if cuts[0].process.teeth > 1 and not is_runout_determined(fit):
        size, error = 1e6 * math.hypot(*fit.runout), 2e6 * max(fit.runout_error)
        reason = "the waveforms are not explained" if fit.misfit > EXPLAINED else f"F-test, p = {fit.runout_chance:.2g}"
        doubts.append(f"a runout of {size:.2g} ± {error:.2g} µm is not determined ({reason}) and not written")
    drifting = [
        f"{cut.name} ({np.abs(cut.drift).max():.2g} N)"
        for cut in cuts
        if np.abs(cut.drift).max() > 0.05 * np.abs(cut.mean[0]).max()
    ]
    if drifting:
        doubts.append(
            f"the zero of the forces drifts in {', '.join(drifting)}: edge coefficients suffer; record some "
            "revolutions in air before and after the cut"
        )
    if by_waveforms and np.isfinite(means).any():
        errors = np.sqrt(np.diag(fit.covariance))
        gap = np.abs(means - fit.coefficients) / np.hypot(mean_errors, errors)
        apart = [f"{COEFFICIENT_SYMBOLS[k]}" for k in range(3) if gap[k] > BEYOND_ERRORS]
        if apart and max(np.abs(fit.runout)) < min(cut.process.feed_per_tooth for cut in cuts) / 10:
            doubts.append(
                f"mean forces and waveforms disagree on {', '.join(apart)} beyond their errors: check the zero of the "
                "sensors and their frequency range"
            )
    return doubts


def _ringing_in_words(ringing: Ringing, cuts: Sequence[CutForces]) -> list[str]:
    """Return what the inferred modes of the dynamometer say, with their evidence."""
    rings = [
        f"{frequency:.0f} Hz along {'XYZ'[axis]} (F-test, p = {chance:.1g})"
        for (frequency, _), chance, axis in zip(ringing.modes, ringing.chances, cuts[0].axes, strict=True)
        if chance < CHANCE
    ]
    if not rings:
        return []
    worst = int(np.argmax(ringing.held_out))
    left_out = f"left-out cuts are predicted to {100 * ringing.held_out[worst]:.2g} % or better"
    if ringing.explains(EXPLAINED):
        return [
            f"the dynamometer rings at {', '.join(rings)}: its transfer is inferred from the cuts, not measured; "
            f"{left_out}; tap it and give --dynamometer"
        ]
    return [
        f"the forces ring at {', '.join(rings)}, but one mode along each axis leaves {100 * ringing.misfit:.0f} %, and "
        f"{100 * ringing.held_out[worst]:.0f} % of {cuts[worst].name} when it is left out: tap the dynamometer and "
        "give --dynamometer"
    ]


def _negative_edges(coefficients: Real) -> list[str]:
    """Return a doubt about edge coefficients that a cutting file cannot hold and gets as 0."""
    negative = [COEFFICIENT_SYMBOLS[k] for k in range(3, 6) if coefficients[k] < 0]
    if not negative:
        return []
    return [
        f"{', '.join(negative)} come out negative, which no edge has, and are set to 0: check the feeds and the "
        "zero of the sensors"
    ]
