"""Fields that tell depth limits and verdicts on cuts."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from millfrf.stability import StabilityLobes

from ..chain import JudgedCut

RPM = np.pi / 30


def lobes_answer(lobes: StabilityLobes) -> dict[str, Any]:
    """The lowest limit, and the limit at each speed with its chatter frequency, bifurcation and status.

    Parameters
    ----------
    lobes
        Stability lobes; a limit that is infinite or not known is null, and ``bifurcation`` and ``status`` say which.
    """
    known = np.isfinite(lobes.depth_limits)
    lowest = int(np.where(known, lobes.depth_limits, np.inf).argmin()) if known.any() else None
    columns = (
        lobes.spindle_speeds_rpm,
        lobes.depth_limits,
        lobes.chatter_frequencies,
        lobes.bifurcations,
        lobes.status,
    )
    names = ("spindle_speed_rpm", "depth_limit_m", "chatter_frequency_hz", "bifurcation", "status")
    return {
        "method": lobes.method,
        "lowest_depth_limit_m": None if lowest is None else lobes.depth_limits[lowest],
        "lowest_at_spindle_speed_rpm": None if lowest is None else lobes.spindle_speeds_rpm[lowest],
        "limits": [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)],
    }


def cuts_answer(cuts: Sequence[JudgedCut]) -> dict[str, Any]:
    """The verdict on each cut with its reason and numbers.

    Parameters
    ----------
    cuts
        Cuts with their verdicts, in the order of the recordings.
    """
    return {
        "cuts": [
            {
                "recording": cut.name,
                "verdict": cut.verdict.kind,
                "reason": cut.verdict.reason,
                "frequency_hz": cut.verdict.frequency,
                "p_value": cut.verdict.p_value,
                "spindle_speed_rpm": cut.verdict.spindle_speed / RPM,
                "stated_speed_rpm": cut.stated_rpm,
                "foreign_tones": [
                    {"frequency_hz": one.frequency, "share": one.share, "name": one.name} for one in cut.verdict.foreign
                ],
            }
            for cut in cuts
        ]
    }
