"""Force coefficients, runout and their errors from cuts at several feeds, with a check of axes, teeth and zero."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import InputError, Real, Result, Summary, counted, doubts_line, with_error
from millfrf.cutting import MillingProcess

from .coefficient_fit import CoefficientFit, fit_cuts, fit_mean_forces
from .cut_forces import CutForces
from .feed_growth import left_out_by_feed
from .force_problem import EDGES, ForceLaw
from .identified_process import LARGEST_EXPONENT, identified_process
from .law_choice import LawChoice, choose_law
from .placements import CHANCE, EXPLAINED, other_teeth, parsed_placement, require_placement
from .ringing import Ringing, find_ringing, moved_modes, with_modes

LEAST_FOR_MODES = 3  # cuts from which modes of a dynamometer are inferred: each is left out in turn
COEFFICIENT_SYMBOLS = ("Ktc", "Krc", "Kac", "Kte", "Kre", "Kae")


@dataclass(frozen=True, eq=False, repr=False)
class CutCoefficients(Result):
    """Force coefficients of a cutter in a material.

    Parameters
    ----------
    process
        Cutter and engagement of the first cut with the identified coefficients, their errors and the runout.
    method
        ``waveforms``: all spindle orders of the forces; ``mean forces``: their means over the revolutions alone, with
        the runout of the waveforms where these are explained.
    coefficients, errors : (6,), Pa and N/m
        ``Ktc, Krc, Kac, Kte, Kre, Kae`` and their standard errors; NaN where no measured axis shows one.
    exponents, exponent_errors : (3,)
        Exponents of the chip thickness of ``Ktc, Krc, Kac`` and their standard errors; 0 without such a law. The
        coefficients hold at ``process.chip_law.reference`` then.
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
    law
        Law that was chosen, and its F-tests; None: no edge radius is stated, or the forces are not explained.
    """

    process: MillingProcess
    method: str
    coefficients: Real
    errors: Real
    exponents: Real
    exponent_errors: Real
    mean_coefficients: Real
    mean_errors: Real
    fit: CoefficientFit
    cuts: tuple[CutForces, ...]
    warnings: tuple[str, ...]
    ringing: Ringing | None = None
    law: LawChoice | None = None

    def _summary(self) -> Summary:
        scales = 3 * [(1e-6, "MPa")] + 3 * [(1e-3, "N/mm")]
        rows = tuple(
            (f"{symbol} ({unit})", with_error(scale * value, 2 * scale * error))
            for symbol, value, error, (scale, unit) in zip(
                COEFFICIENT_SYMBOLS, self.coefficients, self.errors, scales, strict=True
            )
            if math.isfinite(value)
        )
        half = len(rows) // 2
        lines = (", ".join(f"{name} {value}" for name, value in part) for part in (rows[:half], rows[half:]))
        return Summary(
            f"CutCoefficients: of {counted(len(self.cuts), 'cut')}, by {self.method}, "
            f"{100 * self.fit.misfit:.2g} % not explained",
            (*lines, *doubts_line(self.warnings)),
            ("coefficient", "value ± 2 standard errors"),
            rows,
        )


def identify_coefficients(
    cuts: Sequence[CutForces], channels: Sequence[str], axes: Sequence[str] = ()
) -> CutCoefficients:
    """Identify force coefficients from the forces of cuts.

    The forces of all cuts are those of a rigid tool with one set of six coefficients and one runout,

    ``F = sum_j int T(phi_j) (K_c h_j + K_e / sin(gamma)) dz``,

    whose spindle orders are compared with the measured ones (Altintas, Manufacturing Automation, 2nd ed., sections 2.7
    and 2.8). The mean forces, which no resonance of the dynamometer changes, are a second witness: where the waveforms
    are not explained to 10 %, the coefficients of the means are used, and half of the difference is added to their
    errors; where they are but contradict the means (``compared_witnesses``), the whole difference.

    Where the edge radius is known, coefficients that fall with the chip thickness are tried, too (``choose_law``).

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
        The cuts do not separate the coefficients, differ in the axes that were measured, or their forces fit with other
        axes or another number of teeth only.
    """
    most = max(cuts, key=lambda cut: len(cut.axes))
    for cut in cuts:
        if cut.axes != most.axes:
            missing = ", ".join(f"TCP:+{'XYZ'[axis]}" for axis in most.axes if axis not in cut.axes)
            raise InputError(
                f"{cut.name} has no force at {missing}, {most.name} has: add that channel, or leave {cut.name} out"
            )
    placement = parsed_placement(axes or ("+X", "+Y", "+Z"), cuts[0].axes)
    cuts = [placement.of(cut) for cut in cuts]
    fit, ringing, law = fit_cuts(cuts), None, None
    try:
        means, covariance = fit_mean_forces(cuts)
    except InputError:  # a single feed: the waveforms alone tell cutting from edge forces
        means, covariance = np.full(6, np.nan), np.full((9, 9), np.nan)
    else:
        require_placement(cuts, fit, placement, channels)
        _require_teeth(cuts, fit)
        cuts, fit, ringing, law = _explained(cuts, fit)
        if law is not None:
            means, covariance = fit_mean_forces(cuts, law.law, fit.exponents, fit.reference)
    mean_errors = np.sqrt(np.diag(covariance))[:6]
    witnesses = compared_witnesses(cuts, fit, EDGES if law is None else law.law, means, covariance)
    by_waveforms = bool(np.isnan(means).all()) or not (fit.misfit > EXPLAINED or witnesses.contradict)
    if by_waveforms:
        coefficients, covariance = fit.coefficients, fit.covariance
    else:
        explained = fit.misfit <= EXPLAINED
        coefficients = fit.coefficients + witnesses.difference if explained else means
        # waveforms that are explained may be right, and the zero of the means wrong: both lie within the errors
        bias = np.append((fit.coefficients - coefficients) * (1.0 if explained else 0.5), np.zeros(3))
        covariance = covariance + np.outer(bias, bias)
    errors = np.sqrt(np.diag(covariance))
    return CutCoefficients(
        identified_process(
            cuts, coefficients, covariance, fit, math.hypot(*fit.runout) if is_runout_determined(fit) else 0.0
        ),
        "waveforms" if by_waveforms else "mean forces",
        coefficients,
        errors[:6],
        fit.exponents,
        errors[6:],
        means,
        mean_errors,
        fit,
        tuple(cuts),
        (
            *(doubt for cut in cuts for doubt in cut.doubts),
            *([] if ringing is None else _ringing_in_words(ringing, cuts)),
            *_law_in_words(cuts, fit, law),
            *([] if fit.misfit <= EXPLAINED else _growth_in_words(cuts, fit)),
            *([witnesses.sentence] if witnesses.contradict and fit.misfit <= EXPLAINED else []),
            *_doubts(cuts, fit, means, by_waveforms),
            *_negative_edges(coefficients),
        ),
        ringing,
        law,
    )


@dataclass(frozen=True)
class Witnesses:
    """Comparison of the mean forces with those that the fit of the waveforms computes.

    Parameters
    ----------
    difference : (6,), Pa and N/m
        Coefficients of the measured mean forces less those of the computed ones; NaN where they are unknown. Runout
        moves both alike.
    chance
        Probability of so large a difference by the errors of the means (chi-squared test); 1 where it is unknown.
    """

    difference: Real
    chance: float

    @property
    def contradict(self) -> bool:
        """Whether the difference is no chance."""
        return self.chance < CHANCE

    @property
    def sentence(self) -> str:
        """What contradicts, what it may be due to, and what is used."""
        chance = f"p = {self.chance:.1g}" if self.chance > 1e-99 else "p < 1e-99"
        return (
            f"mean forces and waveforms contradict each other (chi-squared test, {chance}): the tool or the workpiece "
            "yields or chatters, the zero of the sensors is off, or the forces are filtered; used are the mean forces, "
            "and the errors include the difference; record some revolutions in air, and cut with a stiffer tool or "
            "less deep"
        )


def compared_witnesses(
    cuts: Sequence[CutForces], fit: CoefficientFit, law: ForceLaw, means: Real, covariance: Real
) -> Witnesses:
    """Compare coefficients of the mean forces, their covariance given, with those of the computed mean forces."""
    known = np.flatnonzero(np.isfinite(means) & (np.diag(covariance)[:6] > 0))
    if not len(known):
        return Witnesses(np.full(6, np.nan), 1.0)
    computed = [
        replace(cut, mean=np.concatenate([fitted[:1], cut.mean[1:]]))
        for cut, fitted in zip(cuts, fit.fitted, strict=True)
    ]
    difference = means - fit_mean_forces(computed, law, fit.exponents, fit.reference)[0]
    errors = np.sqrt(np.diag(covariance))[known]
    own, correlation = difference[known] / errors, covariance[np.ix_(known, known)] / np.outer(errors, errors)
    statistic = float(own @ np.linalg.pinv(correlation, hermitian=True) @ own)
    return Witnesses(difference, float(scipy.stats.chi2.sf(statistic, len(known))))


def _explained(
    cuts: Sequence[CutForces], fit: CoefficientFit
) -> tuple[Sequence[CutForces], CoefficientFit, Ringing | None, LawChoice | None]:
    """Return cuts and fit with the law that the forces need and the modes of a dynamometer that rings, and both."""
    ringing: Ringing | None = None
    moved: Sequence[Sequence[CutForces]] = ()
    law = _chosen_law(cuts, fit, moved)
    if law is None and fit.misfit > EXPLAINED and len(cuts) >= LEAST_FOR_MODES and cuts[0].transfer is None:
        ringing = find_ringing(cuts, fit)
        if ringing.explains(EXPLAINED):
            cuts, moved = with_modes(cuts, ringing.modes), moved_modes(with_modes(cuts, ringing.modes), ringing.modes)
            fit = fit_cuts(cuts, moved)
            law = _chosen_law(cuts, fit, moved)
    return cuts, fit if law is None else law.fit, ringing, law


def _chosen_law(
    cuts: Sequence[CutForces], fit: CoefficientFit, moved: Sequence[Sequence[CutForces]]
) -> LawChoice | None:
    """Return the law that the forces need; None without an edge radius, or if none explains them."""
    return choose_law(cuts, fit, moved, EXPLAINED) if cuts[0].process.chip_law.edge_radius else None


def _law_in_words(cuts: Sequence[CutForces], fit: CoefficientFit, law: LawChoice | None) -> list[str]:
    """Return doubts about the exponents of the chip thickness."""
    if law is None:
        return []
    outside = [name for k, name in enumerate(COEFFICIENT_SYMBOLS[:3]) if not 0 <= fit.exponents[k] <= LARGEST_EXPONENT]
    if not outside:
        return []
    return [
        f"the exponents of {', '.join(outside)} come out below 0 or near 1, which no chip has, and are set to the "
        "nearest possible: cut at feeds that differ more"
    ]


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


def _doubts(cuts: Sequence[CutForces], fit: CoefficientFit, means: Real, by_waveforms: bool) -> list[str]:
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
        f"{cut.name} ({np.abs(cut.drift).max():.2g} N along {'XYZ'[cut.axes[int(np.abs(cut.drift).argmax())]]})"
        for cut in cuts
        if np.abs(cut.drift).max() > 0.05 * np.abs(cut.mean[0]).max()
    ]
    if drifting:
        doubts.append(
            f"the zero of the forces drifts in {', '.join(drifting)}: edge coefficients suffer; record some "
            "revolutions in air before and after each cut, between which the zero is taken as a straight line"
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


def _growth_in_words(cuts: Sequence[CutForces], fit: CoefficientFit) -> list[str]:
    """Return how much of unexplained waveforms is not due to the way in which the force grows with the feed."""
    left_out = left_out_by_feed(cuts, fit.angles)
    if left_out is None:
        return []
    return [
        f"forces that grow linearly with the feed, of any shape and behind any dynamometer, leave "
        f"{100 * left_out.min():.2g} to {100 * left_out.max():.2g} % of a cut between others that is left out: so much "
        "is for the chip's thickness, runout and chatter, the rest for dynamometer, engagement and edges"
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
