"""What is said of an optimised path, in sentences."""

from collections.abc import Sequence

import numpy as np

from millfrf.robot_model import CutPath

from ..certified_search import Wanted
from ..optimum import PathOptimum
from ..path_state import PathState


def summary(found: PathOptimum, wanted: Wanted, max_depth: float, planned: float | None) -> list[str]:
    """Depth, deviation and motion before and after, one line each."""
    lines = []
    for name, state in (("redundancy at zero", found.before), ("chosen postures", found.after)):
        lines.append(f"{name}: {_state(state, max_depth)}")
    steps = np.degrees(np.abs(np.diff(found.after.q, axis=0)).max(initial=0.0))
    lines.append(
        f"largest joint step {steps:.1f} deg; nearest joint limit {np.degrees(found.after.margin.min()):.1f} deg away, "
        f"smallest singular value {found.after.smallest.min():.3f}"
    )
    lines.append(f"{found.evaluated[1]} postures certified; {'; '.join(found.rounds)}")
    if wanted.objective == "both":
        lines += [
            f"front: {1e3 * one.depth:.3g} mm deep with {1e3 * one.deviation:.3g} mm of deviation"
            for one in found.front
        ]
        lines.append(
            f"chosen on it: smallest {wanted.balance:g} x lost depth + {1 - wanted.balance:g} x deviation, both scaled"
        )
    if planned is not None:
        proven = found.after.values.known_depth(max_depth)
        stable = int((proven >= planned).sum())
        lines.append(f"the planned {1e3 * planned:g} mm is below the limit at {stable} of {len(proven)} points")
    return lines


def _state(state: PathState, max_depth: float) -> str:
    here = state.reached
    if not here.any():
        return "no point is reached"
    depth = state.values.known_depth(max_depth)[here]
    beyond = "at least " if depth.min() >= max_depth else ""
    missed = f"; {int((~here).sum())} of {len(here)} points not reached" if not here.all() else ""
    return (
        f"depth limit {beyond}{1e3 * depth.min():.3g} mm at the worst point, {1e3 * depth.mean():.3g} mm on average; "
        f"deviation up to {1e3 * np.nanmax(state.sizes):.3g} mm{missed}"
    )


def doubts(found: PathOptimum, path: CutPath) -> list[str]:
    """Warnings about limits, modes that were left out, and plunging."""
    lines = []
    words = found.after.values.status
    unsure = [k + 1 for k, word in enumerate(words) if word != "verified"]
    if unsure:
        lines.append(f"at {len(unsure)} of {len(words)} points the limit is not verified ({_few(unsure)}): see status")
    plunged = [int(k) + 1 for k in np.flatnonzero(path.plunges)]
    if plunged:
        lines.append(
            f"at points {_few(plunged)} the tool moves along its own axis: depth limits there are those of a cut that "
            "feeds as at the nearest other point, not of plunging"
        )
    kept = found.kept
    if np.isfinite(kept.highest_frequency) and kept.highest_frequency < kept.reference:
        lines.append(
            f"modes above {kept.highest_frequency:.0f} Hz are left as their static flexibility; with modes "
            f"{_up_to(kept.reference)} the limits at {kept.checked} postures change by at most "
            f"{100 * kept.change:.2g} %"
        )
    return lines


def _few(points: Sequence[int]) -> str:
    shown = ", ".join(str(point) for point in points[:5])
    return shown if len(points) <= 5 else f"{shown} and {len(points) - 5} more"


def _up_to(frequency: float) -> str:
    return f"up to {frequency:.0f} Hz" if np.isfinite(frequency) else "of all frequencies"
