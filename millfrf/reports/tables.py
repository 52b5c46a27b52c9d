"""Tables of results, for the terminal and for reports."""

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

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
from millfrf.core import Band, InputError, with_error
from millfrf.core.terminal import Table
from millfrf.gate import clearly_different, shown_pairs
from millfrf.stability import JudgedCut
from modal_fit import (
    ModalFit,
    ModalModel,
    ModeShapes,
    mode_reciprocity,
    mode_shapes,
    read_picked_poles,
    read_pole_groups,
)

SURE = 1e6  # largest odds that are printed: beyond them errors of the assumptions matter, not chance


def odds_in_words(evidence: float) -> str:
    """Format the odds ``exp(evidence / 2)`` of a cause against its absence, rounded.

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
    """Format evidence as odds in words, followed by the number that is stored in files.

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


def points_in_words(dofs: Sequence[str]) -> str:
    """List up to eight names; for more names, give their number, the first and the last name.

    Examples
    --------
    >>> points_in_words(["A:+X", "A:+Y"]), points_in_words([f"{k}:+Z" for k in range(1, 75)])
    ('A:+X, A:+Y', '74 points (1:+Z ... 74:+Z)')
    """
    if len(dofs) <= 8:
        return ", ".join(dofs)
    return f"{len(dofs)} points ({dofs[0]} ... {dofs[-1]})"


MAX_VALUES = 1e7  # samples times channels up to which periods are searched: all samples are in memory
MIN_LINES = 10  # excited lines needed to report distortion: a few harmonics of a cut are no multisine


def repeats_in_words(stream: Stream) -> tuple[str, ...]:
    """Describe the periods of a stream's forces in sentences; no sentence if the forces do not repeat.

    Parameters
    ----------
    stream
        Stream of an open recording.
    """
    forces = [channel for channel in stream.channels if channel.quantity in EXCITING]
    motions = [channel for channel in stream.channels if channel.quantity in RESPONDING]
    if not forces or not motions or stream.n_samples * (len(forces) + len(motions)) > MAX_VALUES:
        return ()
    samples = aligned_samples(stream, [channel.name for channel in (*forces, *motions)])
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
    levels = ", ".join(f"{100 * share:.2g} % of {c.name}" for share, c in zip(shares, channels, strict=True))
    quantities = " and ".join(sorted({channel.quantity for channel in periods.excitations}))
    return (
        f"the {quantities} repeats every {periods.period:.6g} s; noise of one period, {band[0]:.4g} to {band[1]:.4g} "
        f"Hz: {levels}. {noise.statement}"
    )


def _distortion_in_words(periods: SteadyPeriods) -> tuple[str, ...]:
    if excited_lines(periods).sum() < MIN_LINES:
        return ()
    try:
        result = distortion(periods)
    except InputError:  # too few realisations to separate several forces
        return ()
    if result.classes or result.stochastic is not None:
        return result.sentences() or ("no distortion beyond noise at lines that were not excited",)
    return ()


def mode_table(model: ModalModel, title: str = "Modes", band: tuple[float, float] | None = None) -> Table:
    """Make a table of frequencies and damping ratios with twice their standard errors, peaks, and known sources."""
    errors = model.standard_errors()
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
                *((model.mode_sources[r] or "not stated",) if model.sources else ()),
            )
        )
    measured = ("measured",) if model.sources else ()
    columns = ("mode", "frequency (Hz)", "damping ratio (%)", "peak in largest entry", *measured)
    note = " (± 2 standard errors)" if errors is not None else ""
    return Table(title + note, columns, tuple(rows))


def source_table(model: ModalModel, title: str = "Bands") -> Table | None:
    """Make a table of the bands of a model by their measurement, and of what none shows; None if it is not stated."""
    if not model.sources:
        return None
    rows = [
        (f"{band.low:.4g} to {band.high:.4g} Hz", band.source, str(_modes_in(model, band.low, band.high)))
        for band in model.sources
    ]
    if model.unmeasured_flexibility is not None:
        flexibility = f"static flexibility below {model.unmeasured_flexibility:.2g} m/N"
        rows.append((f"above {model.sources[-1].high:.4g} Hz", "not measured", flexibility))
    return Table(title, ("band", "measured", "modes"), tuple(rows))


def _modes_in(model: ModalModel, low: float, high: float) -> int:
    natural = model.natural_frequencies
    return int(((natural >= low) & (natural <= high)).sum())


def agreement_table(provenance: Mapping[str, Any], title: str = "Cut and taps at the sensor") -> Table | None:
    """Make a table of the modes that both tests of a calibration show at the sensor; None if the file has none.

    Parameters
    ----------
    provenance
        Its ``cut_and_taps``, as ``calibrate`` stores it: for each mode ``cut_hz``, ``tapped_hz``, ``assurance``,
        ``factor``, ``factor_phase_deg`` and ``factor_error``.
    title
        Title of the table.
    """
    modes = provenance.get("cut_and_taps")
    try:
        rows = _agreement_rows(modes) if isinstance(modes, list) else []
    except (KeyError, TypeError, ValueError):  # changed by hand
        rows = []
    columns = ("mode", "in the cut (Hz)", "tapped (Hz)", "MAC of residues", "cut / tapped", "phase (°)")
    return Table(f"{title} (± 2 standard errors)", columns, tuple(rows)) if rows else None


def _agreement_rows(modes: Sequence[Mapping[str, float]]) -> list[tuple[str, ...]]:
    return [
        (
            str(number),
            f"{mode['cut_hz']:.2f}",
            f"{mode['tapped_hz']:.2f}",
            f"{mode['assurance']:.3f}",
            f"{mode['factor']:.3f} ± {2 * mode['factor_error']:.1g}",
            f"{mode['factor_phase_deg']:.2g}",
        )
        for number, mode in enumerate(modes, start=1)
    ]


def explained_table(fitted: ModalFit, most: int = 12) -> Table:
    """Make a table of the share of each channel's FRFs that the model explains, of the ``most`` channels with least."""
    model = fitted.model
    responses, excitations = fitted.explained
    rows = [("response", str(channel), share) for channel, share in zip(model.responses, responses, strict=True)]
    rows += [("excitation", str(channel), share) for channel, share in zip(model.excitations, excitations, strict=True)]
    rows = sorted(rows, key=lambda row: row[2])[:most]
    cells = tuple((kind, channel, f"{100 * share:.1f}") for kind, channel, share in rows)
    return Table("Share of the measured FRFs that the modes explain", ("channel", "place", "power (%)"), cells)


def error_table(model: ModalModel, title: str = "Standard errors by source") -> Table | None:
    """Make a table of standard errors of each mode by source; None if the model does not contain them."""
    if model.errors is None:
        return None
    parts = (model.errors.noise, model.errors.points, model.errors.band, model.errors.terms, model.errors.total)
    rows = []
    for r, frequency in enumerate(model.natural_frequencies):
        cells = [f"{part[r, 0]:.2g} / {100 * part[r, 1]:.2g}" if np.isfinite(part[r, 0]) else "-" for part in parts]
        rows.append((str(r + 1), f"{frequency:.3f}", *cells))
    columns = ("mode", "frequency (Hz)", "noise", "a sensor left out", "band edges", "out-of-band terms", "total")
    return Table(f"{title} (Hz / % damping; -: not known from this fit)", columns, tuple(rows))


def shapes_of(model: ModalModel) -> ModeShapes | None:
    """Compute the shapes of a model; None if it has no mode, or a single degree of freedom on each side."""
    if not len(model.poles) or max(len(model.responses), len(model.excitations)) < 2:
        return None
    return mode_shapes(model)


def shape_table(model: ModalModel, title: str = "Mode shapes") -> Table | None:
    """Make a table of MPC, MPD, complexity and the most similar other mode; None if there is no shape."""
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
    """Describe the poles of a file in a line and tables, with the groups of poles that it offers, if any."""
    poles, groups = read_picked_poles(path), read_pole_groups(path)
    rows = tuple(
        (str(number), f"{abs(pole) / (2 * np.pi):.3f}", f"{-100 * pole.real / abs(pole):.3f}")
        for number, pole in enumerate(poles, start=1)
    )
    tables = [Table("picked", ("pole", "frequency (Hz)", "damping ratio (%)"), rows)]
    if groups:
        offered = tuple(
            (
                str(group.number),
                f"{group.frequency:.3f}",
                f"{100 * group.damping_ratio:.3f}",
                str(group.n_orders),
                "taken" if group.taken else group.reason,
            )
            for group in groups
        )
        tables.append(Table("offered", ("group", "frequency (Hz)", "damping ratio (%)", "orders", ""), offered))
    words = f", {len(groups)} groups to pick from" if groups else ""
    return f"{len(poles)} picked poles of {Path(path).name}{words}", tuple(tables)


MAX_PAIRS = 12  # pairs that are listed


def pair_table(frf: Frf, title: str = "Reciprocity", band: Band | None = None) -> Table | None:
    """Make a table of the pairs ``H_pq``, ``H_qp`` with their differences; None if there is no pair."""
    pairs = reciprocity_pairs(frf, band)
    if not pairs:
        return None
    rows = []
    for pair in shown_pairs(pairs, MAX_PAIRS):
        angle = np.degrees(np.angle(pair.factor))
        rows.append(
            (
                f"{pair.first} / {pair.second}",
                f"{100 * pair.difference:.3g}",
                f"{100 * pair.noise:.2g}" if np.isfinite(pair.noise) else "",
                f"{pair.correlation:.3f}",
                f"{abs(pair.factor):.3g} at {angle:.0f}°",
                "disagree" if clearly_different(pair) else "",
            )
        )
    low, high = pairs[0].frequencies[0], pairs[0].frequencies[-1]
    note = f", the worst {MAX_PAIRS} of {len(pairs)} pairs" if len(pairs) > MAX_PAIRS else ""
    columns = ("p / q", "difference (% rms)", "of it noise (%)", "correlation", "ratio", "")
    return Table(f"{title}: H_pq against H_qp, {low:.4g} to {high:.4g} Hz{note}", columns, tuple(rows))


def vector_table(model: ModalModel, title: str = "Reciprocity") -> Table | None:
    """Make a table of left against right vectors; None if they share fewer than two points."""
    reciprocity = mode_reciprocity(model)
    if reciprocity is None:
        return None
    rows = tuple(
        (
            str(mode + 1),
            f"{frequency:.2f}",
            f"{reciprocity.assurance[mode]:.3f}",
            f"{100 * reciprocity.residual[mode]:.2g}",
        )
        for mode, frequency in enumerate(model.natural_frequencies)
    )
    columns = ("mode", "frequency (Hz)", "MAC left / right", "residues not symmetric (%)")
    return Table(f"{title}: left against right vectors on {len(reciprocity.points)} shared points", columns, rows)


def verdict_table(cuts: Sequence[JudgedCut]) -> Table:
    """Make a table with one row per cut: verdict, p-value, non-repeating motion, growth, frequency, speed."""
    rows = []
    for cut in cuts:
        verdict = cut.verdict
        rows.append(
            (
                cut.name,
                "" if math.isnan(verdict.spindle_speed) else f"{verdict.spindle_speed * 30 / math.pi:.1f}",
                verdict.kind,
                f"{verdict.p_value:.0e}" if verdict.p_value < 0.01 else f"{verdict.p_value:.2g}",
                f"{100 * verdict.deviation:.1f} %",
                "" if math.isnan(verdict.growth) else f"{verdict.growth:.2f}",
                "" if math.isnan(verdict.frequency) else f"{verdict.frequency:.2f}",
            )
        )
    columns = ("cut", "speed (rpm)", "verdict", "p of noise", "does not repeat", "last / first eighth", "line (Hz)")
    return Table("Cuts", columns, tuple(rows))


MOST_TONES = 5  # rows for one cut


def tone_table(cuts: Sequence[JudgedCut]) -> Table:
    """Make a table of the strongest tones of each cut that are neither spindle orders nor chatter."""
    rows = []
    for cut in cuts:
        tones = sorted(cut.verdict.foreign, key=lambda tone: -tone.share)
        shown = tones if len(tones) <= MOST_TONES else tones[: MOST_TONES - 1]
        rows += [(cut.name, f"{tone.frequency:.2f}", f"{100 * tone.share:.1f} %", tone.name) for tone in shown]
        if len(shown) < len(tones):
            rest = math.sqrt(sum(tone.share**2 for tone in tones[len(shown) :]))
            rows.append((cut.name, "", f"{100 * rest:.1f} %", f"{len(tones) - len(shown)} further tones together"))
    return Table("Foreign tones", ("cut", "frequency (Hz)", "of the motion", "what it is"), tuple(rows))
