"""Location of a mismatch: frequency bands, channels, times, levels, spindle orders."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..inference.settings import LOCATION, LocationSettings
from ..models.fitting import Fit
from ..models.hypothesis import Hypothesis
from ..physics.library import rig_of
from .maps import BlockResidual, SpindleSpeed, normalised, order_powers, overlap
from .residual_view import ResidualView, holm, linear_part


@dataclass(frozen=True)
class Growth:
    """Residual above noise against force, recording by recording."""

    force: Real  # root mean square force, all directions together, (n_recordings,), N
    # root mean square residual after subtraction of the noise power, and its standard error, each (n_recordings,). Each
    # channel is scaled by its mean response over the recordings. The amplitude is zero if nothing exceeds the noise
    amplitude: Real
    error: Real
    noise: Real  # root mean square noise, in the unit of ``amplitude``, (n_recordings,)
    # exponent of ``amplitude ~ force^exponent`` and its standard error; nan with fewer than two usable levels
    exponent: float
    exponent_error: float


def growth(
    hypothesis: Hypothesis,
    reference: Fit,
    lines: Sequence[WindowedSpectrum],
    bands: Sequence[tuple[float, float]],
    spread: float,
    settings: LocationSettings = LOCATION,
) -> Growth:
    """Return how the residual of a hypothesis grows with the force within bands.

    The residual of a missing linear cause is proportional to the force, the residual of a cubic spring to the third
    power of the force. The residual of dry friction does not grow.

    ``bands``: bands in which the residual was found, as low and high edge, Hz; empty for all frequencies.
    """
    unit = np.sqrt(np.mean([np.mean(np.abs(recording.measured) ** 2, axis=0) for recording in lines], axis=0))
    rows = []
    for number, recording_lines in enumerate(lines):
        single, _, variance = normalised(hypothesis, reference, number, recording_lines)
        inside = _inside(recording_lines.frequencies, bands)
        floor = variance[inside] / unit**2
        power = np.abs(single[inside]) ** 2 * floor
        excess = float(power.sum() - floor.sum())
        chance = 0.5 * float(np.sum(power**2)) * overlap(recording_lines.window)
        error = float(np.sqrt(chance + (spread * float(floor.sum())) ** 2))
        rows.append((recording_lines.recording.level, excess / power.size, error / power.size, float(floor.mean())))
    force, excess_, error_, noise = np.array(rows).T
    amplitude = np.sqrt(np.maximum(excess_, 0.0))
    spreads = error_ / (2 * np.maximum(amplitude, np.sqrt(error_)))
    visible = excess_ > settings.seen * error_
    exponent, exponent_error = _slope(
        force[visible], amplitude[visible], spreads[visible] / amplitude[visible], settings.levels_apart
    )
    return Growth(force, amplitude, spreads, np.sqrt(noise), exponent, exponent_error)


def _inside(frequencies: Real, bands: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
    inside = np.zeros(len(frequencies), dtype=bool)
    for low, high in bands or [(0.0, np.inf)]:
        inside |= (frequencies >= low) & (frequencies <= high)
    return inside


def _slope(force: Real, amplitude: Real, relative: Real, apart: float) -> tuple[float, float]:
    """Return the weighted slope of the logarithms and its standard error, which includes the scatter about the line."""
    if len(force) < 2 or np.ptp(np.log(force)) < apart:
        return float("nan"), float("nan")
    weight = 1 / np.maximum(relative, 1e-3) ** 2
    x, y = np.log(force), np.log(amplitude)
    x0, y0 = np.average(x, weights=weight), np.average(y, weights=weight)
    size = float(np.sum(weight * (x - x0) ** 2))
    slope = float(np.sum(weight * (x - x0) * (y - y0)) / size)
    error = 1 / np.sqrt(size)
    if len(force) > 2:
        misfit = np.sum(weight * (y - y0 - slope * (x - x0)) ** 2) / (len(force) - 2)
        error *= np.sqrt(max(1.0, float(misfit)))
    return slope, float(error)


# ratio of residual to noise power, and number of independent lines, before and after
Tables = tuple[tuple[Real, Real], tuple[Real, Real]]

NO_SPEED = "no recording states the spindle's speed in events or set-up"
NO_ORDER = "no order of the spindle stands out of the residual beside it"


def located(view: ResidualView, speeds: Mapping[str, SpindleSpeed]) -> dict[str, Any]:
    """Return the places of the mismatch from the maps of the residual, as content of a file.

    Every cell of every map is tested for more residual power than noise has. The p-values are adjusted together (Holm):
    pure noise yields any significant place with the probability ``family_wise_level``.
    """
    before, after, level = view.before, view.after, view.settings.family_wise
    tables = {
        "band": (before.pooled_joint(0), after.pooled_joint(0)),
        "channel": (before.pooled((0, 1)), after.pooled((0, 1))),
        "level": (before.pooled_joint(1), after.pooled_joint(1)),
    }
    blocks = [_block_table(blocks) for blocks in view.blocks_before]
    chances = [view.noise.chance(*entry[0]) for entry in tables.values()]
    chances.append(view.noise.chance(before.ratio, before.count[:, :, None]))
    chances += [view.noise.chance(*block) for block in blocks]
    orders = _orders(view, speeds)
    chances.append(np.array([order["p_value"] for order in orders]))
    adjusted = _split(holm(np.concatenate([c.ravel() for c in chances])), chances)
    bands = _bands(before.edges, tables["band"], adjusted[0], level)
    found_orders = [order | {"p_value": float(p)} for order, p in zip(orders, adjusted[-1], strict=True) if p < level]
    return {
        "tests": int(sum(c.size for c in chances)),
        "family_wise_level": level,
        "noise_level_spread": _plain(view.noise.spread),
        "frequency_bands": bands,
        "channels": _named("channel", before.channels, tables["channel"], adjusted[1], level),
        "levels": _levels(view, tables["level"], adjusted[2]),
        # significant cells as indices [recording, band, channel]; bands are about sixth octaves
        "cells": np.argwhere(adjusted[3] < level).tolist(),
        "times": _times(view, blocks, adjusted[4:-1]),
        "growth": _growth(view, bands),
        "spindle_orders": found_orders,
        "spindle_orders_note": NO_SPEED if not speeds else "" if found_orders else NO_ORDER,
    }


def significant_cells(content: Mapping[str, Any], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """Return a mask (n_recordings, n_bands, n_responses) of the cells that ``located`` named."""
    mask = np.zeros(shape, dtype=bool)
    for cell in content["cells"]:
        mask[tuple(cell)] = True
    return mask


def _split(flat: Real, like: Sequence[Real]) -> list[Real]:
    ends = np.cumsum([array.size for array in like])[:-1]
    return [part.reshape(array.shape) for part, array in zip(np.split(flat, ends), like, strict=True)]


def _block_table(blocks: BlockResidual) -> tuple[Real, Real]:
    mean = blocks.power.mean(axis=1)
    return mean, np.full(len(mean), blocks.power.shape[1] * blocks.channels / blocks.overlap)


def _plain(value: float) -> float | None:
    """Return a value rounded to four digits; None where it is not finite."""
    return float(f"{value:.4g}") if np.isfinite(value) else None


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return beginning and end of each unbroken stretch of a mask."""
    steps = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(steps[::2], steps[1::2], strict=True)]


def _bands(edges: Real, tables: Tables, p_value: Real, level: float) -> list[dict[str, Any]]:
    """Return significant bands with their neighbours joined, most excess first."""
    before, after = tables
    excess = np.maximum(before[0] - 1, 0) * before[1]
    bands_content = []
    for start, stop in _runs(p_value < level):
        part = slice(start, stop)
        peak = start + int(np.argmax(excess[part]))
        weights = np.maximum(before[1][part], 1e-9), np.maximum(after[1][part], 1e-9)
        bands_content.append(
            {
                "low_hz": _plain(edges[start]),
                "high_hz": _plain(edges[stop]),
                "peak_hz": _plain(float(np.sqrt(edges[peak] * edges[peak + 1]))),
                "before": _plain(float(np.average(before[0][part], weights=weights[0]))),
                "after": _plain(float(np.average(after[0][part], weights=weights[1]))),
                "share": _plain(float(excess[part].sum() / max(excess.sum(), 1e-300))),
                "p_value": float(p_value[part].min()),
            }
        )
    return sorted(bands_content, key=lambda band: -(band["share"] or 0.0))


def _named(key: str, names: Sequence[str], tables: Tables, p_value: Real, level: float) -> list[dict[str, Any]]:
    (before, count), (after, _) = tables
    excess = np.maximum(before - 1, 0) * count
    return [
        {
            key: name,
            "before": _plain(before[k]),
            "after": _plain(after[k]),
            "share": _plain(excess[k] / max(float(excess.sum()), 1e-300)),
            "p_value": float(p_value[k]),
            "significant": bool(p_value[k] < level),
        }
        for k, name in enumerate(names)
    ]


def _levels(view: ResidualView, tables: Tables, p_value: Real) -> list[dict[str, Any]]:
    rows = _named("recording", view.before.recordings, tables, p_value, view.settings.family_wise)
    return [
        row | _drive([recording.recording.level], view, single=True)
        for row, recording in zip(rows, view.measured, strict=True)
    ]


def _drive(levels: Sequence[float], view: ResidualView, *, single: bool = False) -> dict[str, Any]:
    """Return the excitation levels with their unit: ``force_rms_n`` in newtons, ``drive_rms`` in any other unit."""
    unit = rig_of(view.details.final.hypothesis.model).force_unit
    values = [_plain(level) for level in levels]
    level_values = values[0] if single else values
    return {"force_rms_n": level_values} if unit == "N" else {"drive_rms": level_values, "drive_unit": unit}


def _times(view: ResidualView, tables: Sequence[tuple[Real, Real]], p_values: Sequence[Real]) -> list[dict[str, Any]]:
    """Return the stretches of time whose blocks are significant."""
    intervals = []
    for blocks, (ratio, _), p_value in zip(view.blocks_before, tables, p_values, strict=True):
        for start, stop in _runs(p_value < view.settings.family_wise):
            intervals.append(
                {
                    "recording": blocks.recording,
                    "start_s": _plain(blocks.times[start]),
                    "end_s": _plain(blocks.times[stop]),
                    "before": _plain(float(ratio[start:stop].mean())),
                    "p_value": float(p_value[start:stop].min()),
                }
            )
    return intervals


def _growth(view: ResidualView, bands: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the growth of two residuals: after the refit, and of the final model without its joint laws."""
    ranges = [(band["low_hz"], band["high_hz"]) for band in bands]
    if not ranges:
        return {"note": "no band stands above the noise, so no growth can be told"}
    details = view.details
    refitted = growth(details.base.hypothesis, view.reference, view.measured, ranges, view.noise.spread, view.settings)
    content = {"residual": _growth_content(refitted, view)}
    bare = linear_part(details)
    if bare is not None:
        content["effect"] = _growth_content(
            growth(bare, view.reference, details.recordings, ranges, view.noise.spread, view.settings), view
        )
    return content


def _growth_content(growth_of_residual: Growth, view: ResidualView) -> dict[str, Any]:
    return {
        **_drive([float(x) for x in growth_of_residual.force], view),
        "amplitude": [_plain(x) for x in growth_of_residual.amplitude],
        "standard_error": [_plain(x) for x in growth_of_residual.error],
        "noise": [_plain(x) for x in growth_of_residual.noise],
        "exponent": _plain(growth_of_residual.exponent),
        "exponent_standard_error": _plain(growth_of_residual.exponent_error),
    }


def _orders(view: ResidualView, speeds: Mapping[str, SpindleSpeed]) -> list[dict[str, Any]]:
    """Return the contrast of every spindle order in every recording that states a speed, with its p-value."""
    rows = []
    for blocks in view.blocks_before:
        if blocks.recording not in speeds:
            continue
        on, off, count = order_powers(blocks, speeds[blocks.recording])
        for k in np.flatnonzero(count > 0):
            ratio = float(on[k] / max(off[k], 1e-12))
            chance = float(scipy.stats.f.sf(ratio / view.noise.level, 2 * count[k], 2 / view.noise.spread**2))
            rows.append(
                {"recording": blocks.recording, "order": int(k + 1), "contrast": _plain(ratio), "p_value": chance}
            )
    return rows
