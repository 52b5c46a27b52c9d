"""Cutting process with identified coefficients, their covariance in the units of a cutting file, and the runout."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from millfrf.core import InputError, Real
from millfrf.cutting import ChipLaw, MillingProcess

from .coefficient_fit import CoefficientFit
from .cut_forces import CutForces

LARGEST_EXPONENT = 0.99  # that is written


def identified_process(
    cuts: Sequence[CutForces], coefficients: Real, covariance: Real, fit: CoefficientFit, runout: float
) -> MillingProcess:
    """Return the process of the first cut with identified coefficients; shares have errors of the first order.

    Parameters
    ----------
    cuts
        Forces of the cuts.
    coefficients : (6,), Pa and N/m
        ``Ktc, Krc, Kac, Kte, Kre, Kae``; for NaN the process keeps its share.
    covariance : (9, 9)
        Of coefficients and exponents.
    fit
        Fit whose exponents the coefficients belong to.
    runout : m
        Runout of the cutter.

    Raises
    ------
    InputError
        A tangential coefficient that is not positive, or not determined.
    """
    first = cuts[0].process
    _require_determined(float(coefficients[0]), math.sqrt(float(covariance[0, 0])))
    tangential = float(coefficients[0])
    numbers = np.concatenate([coefficients, fit.exponents])
    known = np.isfinite(numbers) & np.isfinite(np.diag(covariance))
    by_share = np.diag(np.where(known, 1.0, 0.0))  # derivative of the file's numbers by the coefficients
    values = np.where(known, numbers, 0.0)
    for k, share in ((1, first.krc), (2, first.kac)):
        if known[k]:
            share = values[k] / tangential
            by_share[k, k], by_share[k, 0] = 1 / tangential, -share / tangential
        else:
            values[6 + k] = values[6]
        values[k] = share
    errors = by_share @ np.where(np.outer(known, known), covariance, 0.0) @ by_share.T
    for k, error in ((1, first.krc_std), (2, first.kac_std)):
        if not known[k]:
            errors[k, k] = error**2
    edges = np.maximum(values[3:6], 0.0)
    deviations = np.sqrt(np.diag(errors)[:3])
    size = 9 if fit.exponents.any() else 6
    symmetric = (errors + errors.T)[:size, :size] / 2
    return replace(
        first,
        ktc=tangential, krc=float(values[1]), kac=float(values[2]),
        kte=float(edges[0]), kre=float(edges[1]), kae=float(edges[2]), runout=runout,
        ktc_std=float(deviations[0]), krc_std=float(deviations[1]), kac_std=float(deviations[2]),
        covariance=tuple(tuple(float(value) for value in row) for row in symmetric),
        chip_law=_chip_law(first.chip_law, fit, values[6:]),
    )  # fmt: skip


def _chip_law(stated: ChipLaw, fit: CoefficientFit, exponents: Real) -> ChipLaw:
    if not fit.exponents.any():
        return ChipLaw(edge_radius=stated.edge_radius)
    bounded = np.clip(exponents, 0.0, LARGEST_EXPONENT)
    return ChipLaw((float(bounded[0]), float(bounded[1]), float(bounded[2])), fit.reference, stated.edge_radius)


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
