"""Left-out cuts by a force that grows linearly with the feed, of any shape and behind any dynamometer."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from millfrf.core import Complex, Index, Real

from .cut_forces import CutForces
from .force_problem import SCAN

LEAST_CUTS = 4  # a line through the others of a left-out cut needs one more than its two ends
SAME_SPEED = 0.01  # of the speed: so much may cuts differ whose orders pass a resonance alike


def left_out_by_feed(cuts: Sequence[CutForces], angles: Real) -> Real | None:
    """Return the misfit of each cut between others by the line ``a_k + b_k f`` over the feed through the others.

    Forces ``K_c h + K_e`` of teeth that keep in the cut are such a line at each spindle order and axis, whatever the
    engagement and shape of the edges; so they are behind any linear dynamometer. The angle at which a cut begins is
    its own.

    Parameters
    ----------
    cuts
        Forces of cuts.
    angles : (n_cuts,), rad
        Angles of tooth 0 where they begin, about.

    Returns
    -------
    (n_cuts - 2,), or None
        Share of the root mean square of each cut but those of the least and the largest feed; None for fewer than four
        cuts, and for cuts that differ in more than the feed.
    """
    if len(cuts) < LEAST_CUTS or not _differ_in_feed(cuts):
        return None
    by_feed = np.argsort([cut.process.feed_per_tooth for cut in cuts])
    feeds = np.array([cuts[k].process.feed_per_tooth for k in by_feed])
    orders = np.arange(min(cut.top for cut in cuts) + 1)
    twice = np.where(orders > 0, np.sqrt(2.0), 1.0)[:, None]  # an order stands for its conjugate too
    lines = np.array([cuts[k].mean[orders] * twice for k in by_feed])
    begins = np.asarray(angles)[by_feed]
    return np.array([_misfit(lines, feeds, begins, orders, k) for k in range(1, len(cuts) - 1)])


def _differ_in_feed(cuts: Sequence[CutForces]) -> bool:
    """Return whether cuts have one speed, depth and cutter, and all feeds differ."""
    conditions = {(replace(cut.process, feed_per_tooth=0.0), cut.depth, cut.axes) for cut in cuts}
    speeds = np.array([cut.turning.mean() for cut in cuts])
    return (
        len(conditions) == 1
        and len({cut.process.feed_per_tooth for cut in cuts}) == len(cuts)
        and bool(np.ptp(speeds) < SAME_SPEED * speeds.mean())
    )


def _misfit(lines: Complex, feeds: Real, begins: Real, orders: Index, left_out: int) -> float:
    """Return the misfit of one cut by the others."""
    others = np.delete(np.arange(len(feeds)), left_out)
    straight = np.column_stack([np.ones(len(others)), feeds[others]])

    def turned(cut: int, angle: float) -> Complex:
        return np.asarray(lines[cut] * np.exp(-1j * orders * angle)[:, None])

    def fitted(free: Real) -> tuple[Complex, Complex]:
        at = np.concatenate([begins[others[:1]], free])  # a turn of all cuts changes nothing
        known = np.array([turned(cut, angle).ravel() for cut, angle in zip(others.tolist(), at, strict=True)])
        ends = np.linalg.lstsq(straight, known, rcond=None)[0]
        return ends, known - straight @ ends

    def residual(free: Real) -> Real:
        rest = fitted(free)[1].ravel()
        return np.concatenate([rest.real, rest.imag])

    ends = fitted(scipy.optimize.least_squares(residual, begins[others[1:]]).x)[0]
    expected = np.array([1.0, feeds[left_out]]) @ ends

    def missed(angle: float) -> float:
        return float(np.sum(np.abs(turned(left_out, angle).ravel() - expected) ** 2))

    step = 2 * np.pi / SCAN
    nearest = min(step * np.arange(SCAN), key=missed)
    best = scipy.optimize.minimize_scalar(missed, bounds=(nearest - step, nearest + step), method="bounded")
    return float(np.sqrt(best.fun / np.sum(np.abs(lines[left_out]) ** 2)))
