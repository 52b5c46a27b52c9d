"""Tables of results, for the terminal and for reports."""

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from acquisition import Stream, aligned_samples
from estimation import (
    EXCITING,
    RESPONDING,
    BandRecording,
    Frf,
    SteadyPeriods,
    distortion,
    excited_lines,
    find_repeats,
    noise_of_periods,
    reciprocity_pairs,
    steady_periods,
)
from millfrf.core import Band, InputError
from millfrf.core.terminal import Table
from millfrf.gate import plainly_different, shown_pairs
from millfrf.stability import JudgedCut
from modal_fit import (
    ModalModel,
    ModeShapes,
    frequency_and_damping_errors,
    mode_reciprocity,
    mode_shapes,
    read_picked_poles,
    read_pole_groups,
)

SURE = 1e6
"""Odds beyond which a larger number says no more: the error is then in what was assumed, not in chance."""


def odds_in_words(evidence: float) -> str:
    """Odds ``exp(evidence / 2)`` of a cause against its absence, rounded.

    Parameters
    ----------
    evidence
        Gain in score by the cause, twice the natural logarithm of the odds (Kass & Raftery 1995).

    Examples
    --------
    >>> odds_in_words(20.0), odds_in_words(1e4), odds_in_words(2.0)
    ('22 000 to one', 'more than a million to one', 'less than ten to one')
    """
    if evidence >= 2 * math.log(SURE):
        return "more than a million to one"
    if evidence < 2 * math.log(10):
        return "less than ten to one"
    odds = math.exp(evidence / 2)
    rounded = round(odds, 1 - math.floor(math.log10(odds)))
    return f"{rounded:,.0f} to one".replace(",", " ")


def evidence_in_words(evidence: float) -> str:
    """Odds in words, with the number that stands in files.

    Parameters
    ----------
    evidence
        Gain in score by the cause, twice the natural logarithm of the odds.

    Examples
    --------
    >>> evidence_in_words(20.0)
    'odds 22 000 to one (evidence 20)'
    """
    return f"odds {odds_in_words(evidence)} (evidence {evidence:.0f})"


MOST_POINTS = 8
"""Names that are listed."""


def points_in_words(dofs: Sequence[str]) -> str:
    """All names where they are few, else how many with the first and the last.

    Examples
    --------
    >>> points_in_words(["A:+X", "A:+Y"]), points_in_words([f"{k}:+Z" for k in range(1, 75)])
    ('A:+X, A:+Y', '74 points (1:+Z ... 74:+Z)')
    """
    if len(dofs) <= MOST_POINTS:
        return ", ".join(dofs)
    return f"{len(dofs)} points ({dofs[0]} ... {dofs[-1]})"


MOST_VALUES = 1e7
"""Samples times channels up to which a recording is looked at for periods: the whole of it is held in memory."""

FEWEST_LINES = 10
"""Excited lines from which distortion is told: a few harmonics of a cut are no multisine."""


def repeats_in_words(stream: Stream) -> tuple[str, ...]:
    """Sentences about the periods of a stream's forces; none where these do not repeat.

    Parameters
    ----------
    stream
        Samples of an open recording.
    """
    forces = [one for one in stream.channels if one.quantity in EXCITING]
    motions = [one for one in stream.channels if one.quantity in RESPONDING]
    if not forces or not motions or stream.n_samples * (len(forces) + len(motions)) > MOST_VALUES:
        return ()
    samples = aligned_samples(stream, [one.name for one in (*forces, *motions)])
    m = len(forces)
    repeated = find_repeats(samples[:, :m]) if np.isfinite(samples).all() else None
    if repeated is None:
        return ()
    recording = BandRecording(
        stream.name, stream.sample_rate, samples[:, :m], samples[:, m:], tuple(forces), tuple(motions)
    )
    try:
        periods = steady_periods([recording], repeated)
    except InputError:  # no two whole periods between the edges of the interpolation
        return ()
    if not excited_lines(periods).any():
        return ()
    return (_noise_in_words(periods), *_distortion_in_words(periods))


def _noise_in_words(periods: SteadyPeriods) -> str:
    driven = periods.frequencies[excited_lines(periods)]
    band = (float(driven.min()), float(driven.max()))
    noise = noise_of_periods(periods.within(band))
    channels = (*periods.responses, *periods.excitations)
    shares = (*noise.response_share, *noise.force_share)
    said = ", ".join(f"{100 * share:.2g} % of {one.name}" for share, one in zip(shares, channels, strict=True))
    what = " and ".join(sorted({one.quantity for one in periods.excitations}))
    return (
        f"the {what} repeats every {periods.period:.6g} s; noise of one period, {band[0]:.4g} to {band[1]:.4g} Hz: "
        f"{said}. {noise.statement}"
    )


def _distortion_in_words(periods: SteadyPeriods) -> tuple[str, ...]:
    if excited_lines(periods).sum() < FEWEST_LINES:
        return ()
    try:
        found = distortion(periods)
    except InputError:  # too few realisations to tell several forces apart
        return ()
    if found.classes or found.stochastic is not None:
        return found.sentences() or ("no distortion beyond noise at lines that were not excited",)
    return ()


def with_error(value: float, error: float, *, sign: bool = False) -> str:
    """A value and its error with as many decimals as two digits of the error need.

    Examples
    --------
    >>> with_error(16.98997, 0.000069)
    '16.989970 ± 0.000069'
    >>> with_error(638.374, 0.27), with_error(2.85, float("nan"))
    ('638.37 ± 0.27', '2.850')
    """
    plus = "+" if sign else ""
    if not np.isfinite(error):
        return f"{value:{plus}.3f}"
    decimals = int(np.clip(1 - np.floor(np.log10(error)), 0, 7)) if error > 0 else 3
    return f"{value:{plus}.{decimals}f} ± {error:.{decimals}f}"


def mode_table(model: ModalModel, title: str = "Modes", band: tuple[float, float] | None = None) -> Table:
    """Natural frequency and damping ratio of each mode with twice their standard errors, and the residue's size."""
    errors = frequency_and_damping_errors(model)
    rows = []
    for r, (frequency, zeta) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True)):
        if band is not None and not band[0] <= frequency <= band[1]:
            continue
        spread = (np.nan, np.nan) if errors is None else (2 * errors[0][r], 200 * errors[1][r])
        size = np.abs(model.right[r]).max() * np.abs(model.left[r]).max()
        peak = size / abs(model.poles[r].real) if model.poles[r].real else np.inf
        rows.append(
            (
                str(r + 1),
                with_error(float(frequency), spread[0]),
                with_error(float(100 * zeta), spread[1]),
                f"{peak:.3g} {model.unit}",
            )
        )
    columns = ("mode", "frequency (Hz)", "damping ratio (%)", "peak in largest entry")
    note = " (± 2 standard errors)" if errors is not None else ""
    return Table(title + note, columns, tuple(rows))


def error_table(model: ModalModel, title: str = "Standard errors by source") -> Table | None:
    """Standard errors of each mode by where they come from; None where the model does not say."""
    if model.errors is None:
        return None
    parts = (model.errors.noise, model.errors.points, model.errors.band, model.errors.terms, model.errors.total)
    rows = []
    for r, frequency in enumerate(model.natural_frequencies):
        cells = [f"{part[r, 0]:.2g} / {100 * part[r, 1]:.2g}" if np.isfinite(part[r, 0]) else "-" for part in parts]
        rows.append((str(r + 1), f"{frequency:.3f}", *cells))
    columns = ("mode", "frequency (Hz)", "noise", "a sensor left out", "band edges", "out-of-band terms", "total")
    return Table(f"{title} (Hz / % damping; -: cannot be told from this fit)", columns, tuple(rows))


def shapes_of(model: ModalModel) -> ModeShapes | None:
    """The shapes of a model; None where it has no mode, or a single degree of freedom on either side."""
    if not len(model.poles) or max(len(model.responses), len(model.excitations)) < 2:
        return None
    return mode_shapes(model)


def shape_table(model: ModalModel, title: str = "Mode shapes") -> Table | None:
    """MPC, MPD, complexity and the most alike other mode; None where there is no shape."""
    shapes = shapes_of(model)
    if shapes is None:
        return None
    rows = []
    for mode, frequency in enumerate(model.natural_frequencies):
        other = shapes.most_alike(mode)
        rows.append(
            (
                str(mode + 1),
                f"{frequency:.2f}",
                f"{shapes.collinearity[mode]:.3f}",
                f"{np.degrees(shapes.deviation[mode]):.1f}",
                f"{100 * shapes.complexity[mode]:.1f}",
                "" if other is None else f"{other[1]:.2f} with mode {other[0] + 1}",
            )
        )
    columns = ("mode", "frequency (Hz)", "MPC", "MPD (°)", "complexity (%)", "largest MAC")
    return Table(f"{title} ({shapes.side} vectors, {len(shapes.dofs)} points)", columns, tuple(rows))


def poles_in_words(path: str | os.PathLike[str]) -> tuple[str, tuple[Table, ...]]:
    """A line and a table of the poles, and of the groups that are offered where the file holds some."""
    poles, groups = read_picked_poles(path), read_pole_groups(path)
    rows = tuple(
        (str(number), f"{abs(pole) / (2 * np.pi):.3f}", f"{-100 * pole.real / abs(pole):.3f}")
        for number, pole in enumerate(poles, start=1)
    )
    tables = [Table("picked", ("pole", "frequency (Hz)", "damping ratio (%)"), rows)]
    if groups:
        offered = tuple(
            (
                str(one.number),
                f"{one.frequency:.3f}",
                f"{100 * one.damping_ratio:.3f}",
                str(one.n_orders),
                "taken" if one.taken else one.reason,
            )
            for one in groups
        )
        tables.append(Table("offered", ("group", "frequency (Hz)", "damping ratio (%)", "orders", ""), offered))
    words = f", {len(groups)} groups to pick from" if groups else ""
    return f"{len(poles)} picked poles of {Path(path).name}{words}", tuple(tables)


MOST_PAIRS = 12
"""Pairs that are listed."""


def pair_table(frf: Frf, title: str = "Reciprocity", band: Band | None = None) -> Table | None:
    """Each pair ``H_pq``, ``H_qp`` with its disagreement; None where the FRF holds no such pair."""
    pairs = reciprocity_pairs(frf, band)
    if not pairs:
        return None
    rows = []
    for pair in shown_pairs(pairs, MOST_PAIRS):
        angle = np.degrees(np.angle(pair.factor))
        rows.append(
            (
                f"{pair.first} / {pair.second}",
                f"{100 * pair.difference:.3g}",
                f"{100 * pair.noise:.2g}" if np.isfinite(pair.noise) else "",
                f"{pair.correlation:.3f}",
                f"{abs(pair.factor):.3g} at {angle:.0f}°",
                "disagree" if plainly_different(pair) else "",
            )
        )
    low, high = pairs[0].frequencies[0], pairs[0].frequencies[-1]
    note = f", the worst {MOST_PAIRS} of {len(pairs)} pairs" if len(pairs) > MOST_PAIRS else ""
    columns = ("p / q", "difference (% rms)", "of it noise (%)", "correlation", "ratio", "")
    return Table(f"{title}: H_pq against H_qp, {low:.4g} to {high:.4g} Hz{note}", columns, tuple(rows))


def vector_table(model: ModalModel, title: str = "Reciprocity") -> Table | None:
    """Left against right vectors, mode by mode; None where they share fewer than two points."""
    found = mode_reciprocity(model)
    if found is None:
        return None
    rows = tuple(
        (str(mode + 1), f"{frequency:.2f}", f"{found.assurance[mode]:.3f}", f"{100 * found.residual[mode]:.2g}")
        for mode, frequency in enumerate(model.natural_frequencies)
    )
    columns = ("mode", "frequency (Hz)", "MAC left / right", "residues not symmetric (%)")
    return Table(f"{title}: left against right vectors on {len(found.points)} shared points", columns, rows)


_CERTAIN = 0.01  # p-value below which its order of magnitude is enough


def verdict_table(cuts: Sequence[JudgedCut]) -> Table:
    """One row a recording: verdict, its p-value, size of what does not repeat, growth, frequency, spindle."""
    rows = []
    for cut in cuts:
        found = cut.verdict
        rows.append(
            (
                cut.name,
                f"{found.spindle_speed * 30 / math.pi:.1f}",
                found.kind,
                f"{found.p_value:.0e}" if found.p_value < _CERTAIN else f"{found.p_value:.2g}",
                f"{100 * found.deviation:.1f} %",
                "" if math.isnan(found.growth) else f"{found.growth:.2f}",
                "" if math.isnan(found.frequency) else f"{found.frequency:.2f}",
            )
        )
    columns = ("cut", "speed (rpm)", "verdict", "p of noise", "does not repeat", "last / first eighth", "line (Hz)")
    return Table("Cuts", columns, tuple(rows))


def tone_table(cuts: Sequence[JudgedCut]) -> Table:
    """Tones that are neither the spindle's nor chatter, one row each."""
    rows = [
        (cut.name, f"{tone.frequency:.2f}", f"{100 * tone.share:.1f} %", tone.name)
        for cut in cuts
        for tone in cut.verdict.foreign
    ]
    return Table("Foreign tones", ("cut", "frequency (Hz)", "of the motion", "what it is"), tuple(rows))
