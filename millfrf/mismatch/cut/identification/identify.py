"""Force coefficients, runout and their errors from cuts at several feeds, with a check of axes, teeth and zero."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import InputError, Real
from millfrf.core.results import Result
from millfrf.cutting import MillingProcess

from .coefficient_fit import CoefficientFit, fit_cuts, fit_mean_forces
from .cut_forces import CutForces
from .placements import other_teeth, parsed_placement, require_placement

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
    try:
        means, covariance = fit_mean_forces(cuts)
    except InputError:  # a single feed: the waveforms alone tell cutting from edge forces
        means, covariance = np.full(6, np.nan), np.full((6, 6), np.nan)
    else:
        require_placement(cuts, fit, placement, channels)
        _require_teeth(cuts, fit)
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
        (*_doubts(cuts, fit, means, mean_errors, by_waveforms), *_negative_edges(coefficients)),
    )


def _require_teeth(cuts: Sequence[CutForces], fit: CoefficientFit) -> None:
    stated = cuts[0].process.teeth
    teeth = other_teeth(cuts, fit)
    if teeth is not None:
        raise InputError(
            f"the forces repeat as those of {teeth} teeth, not of the {stated} of the cutting file, or the spindle "
            f"turns {stated / teeth:.3g} times as fast as stated; correct teeth and feed_per_tooth_m, or the speed"
        )


def _process(cuts: Sequence[CutForces], coefficients: Real, covariance: Real, fit: CoefficientFit) -> MillingProcess:
    """Return the process of the first cut with the identified coefficients; shares have errors of the first order."""
    first = cuts[0].process
    tangential = float(coefficients[0])
    if not tangential > 0:
        raise InputError(
            f"the tangential coefficient comes out as {tangential / 1e6:.4g} MPa; check the feeds, which are per tooth "
            "and in metres, the depth and the unit of the forces"
        )
    deviation = math.sqrt(float(covariance[0, 0]))
    if deviation >= tangential:
        raise InputError(
            f"the tangential coefficient, {tangential / 1e6:.4g} MPa, has a standard error of {deviation / 1e6:.4g} "
            "MPa: these cuts do not determine it; cut at three or more feeds, or compare lower frequencies (--highest)"
        )
    shares, deviations = [], []
    for k in (1, 2):
        share = float(coefficients[k]) / tangential
        if not math.isfinite(share):
            shares.append(getattr(first, ("krc", "kac")[k - 1]))
            deviations.append(getattr(first, ("krc_std", "kac_std")[k - 1]))
            continue
        variance = covariance[k, k] - 2 * share * covariance[0, k] + share**2 * covariance[0, 0]
        shares.append(share)
        deviations.append(math.sqrt(max(float(variance), 0.0)) / tangential)
    edges = [max(float(value), 0.0) if math.isfinite(value) else 0.0 for value in coefficients[3:]]
    return replace(
        first,
        ktc=tangential, krc=shares[0], kac=shares[1],
        kte=edges[0], kre=edges[1], kae=edges[2],
        runout=math.hypot(*fit.runout),
        ktc_std=deviation,
        krc_std=deviations[0], kac_std=deviations[1],
    )  # fmt: skip


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


def _negative_edges(coefficients: Real) -> list[str]:
    """Return a doubt about edge coefficients that a cutting file cannot hold and gets as 0."""
    negative = [COEFFICIENT_SYMBOLS[k] for k in range(3, 6) if coefficients[k] < 0]
    if not negative:
        return []
    return [
        f"{', '.join(negative)} come out negative, which no edge has, and are set to 0: check the feeds and the "
        "zero of the sensors"
    ]
