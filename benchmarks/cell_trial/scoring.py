"""Scores of the trial: unstable advice, cells with advice, removal rate, errors of verified limits, failures."""

from collections.abc import Sequence
from typing import Any

import numpy as np

TOLERANCE = 0.07
"""Relative error up to which a verified limit is right."""

HEAD = (
    "| cell | modes, outside, hidden (Hz) | cut | passing (Hz) | advice | of best | judges | verified: worst | said |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


def verified_errors(result: dict[str, Any]) -> list[tuple[float, float, float, float]]:
    """Speed (rpm), limit, truth and relative error of every verified limit, all limited to the largest depth."""
    deepest, rows = result.get("max_depth", 0.0), []
    for speed, limit, _, _, status, truth in result.get("compared", ()):
        if status == "verified":
            said, true = min(limit, deepest), min(truth, deepest)
            rows.append((speed, limit, truth, said / true - 1))
    return rows


def unstable(result: dict[str, Any]) -> bool:
    """Whether a recommended cut is unstable by one of the judges."""
    return result.get("advice") is not None and (result["radius"] > 1 or not result["in_time"]["stable"])


def table_of(results: Sequence[dict[str, Any]]) -> str:
    """Summary and a row for each cell, in Markdown."""
    advised = [one for one in results if one.get("advice") is not None]
    bad = [one["number"] for one in results if unstable(one)]
    drifting = [one["number"] for one in advised if not unstable(one) and max(one["drifted"]) > 1]
    shares = [one["share_of_best"] for one in advised]
    errors = {one["number"]: [row[3] for row in verified_errors(one)] for one in results}
    every = np.array([error for rows in errors.values() for error in rows])
    off = [number for number, rows in errors.items() if any(abs(error) > TOLERANCE for error in rows)]
    failed = [one["number"] for one in results if one.get("failed") or one.get("crashed")]
    silent = [
        one["number"]
        for one in results
        if one.get("advice") is None and not one.get("reason") and not one.get("failed")
    ]
    seconds = [one["all_seconds"] for one in results if "all_seconds" in one]
    lines = [
        f"cells {len(results)}; with advice {len(advised)}; unstable advice {bad or 'none'}",
        f"stable advice that is unstable 2 % faster or slower: {drifting or 'none'}",
        f"advised over best removal rate: median {_percent(np.median(shares) if shares else np.nan)}",
        f"verified limits: {len(every)}, beyond 7 % of the truth {int((np.abs(every) > TOLERANCE).sum())} in cells "
        f"{off or 'none'}, largest error {_percent(every[np.argmax(np.abs(every))] if len(every) else np.nan)}",
        f"failed or refused: {failed or 'none'}; no advice without a reason: {silent or 'none'}",
        f"processor time of a cell: {np.mean(seconds) if seconds else np.nan:.0f} s (largest "
        f"{max(seconds, default=np.nan):.0f} s)",
        "",
        HEAD,
        *map(_row, results),
    ]
    return "\n".join([*lines, ""])


def _percent(share: float) -> str:
    return f"{100 * share:+.0f} %" if np.isfinite(share) else "-"


def _row(one: dict[str, Any]) -> str:
    if "crashed" in one:
        return f"| {one['number']} | | | | | | | | trial crashed: {one['crashed'].strip().splitlines()[-1]} |"
    hz = "; ".join(" ".join(f"{f:.1f}" for f in one[key]) or "-" for key in ("modes_hz", "outside_hz", "hidden_hz"))
    cut = one["cut"]
    passing = " to ".join(f"{speed * cut['teeth'] / 60:.0f}" for speed in one["speeds_rpm"])
    advice = share = judges = "-"
    if one["advice"] is not None:
        speed, depth = one["advice"]
        advice, share = f"{1e3 * depth:.3g} mm at {speed:.0f}", _percent(one["share_of_best"])
        judges = f"|mu| {one['radius']:.3f}, limit {1e3 * one['true_limit']:.3g} mm, time {one['in_time']['stable']}"
    errors = verified_errors(one)
    worst = max(errors, key=lambda row: abs(row[3]), default=None)
    verified = "none"
    if worst is not None:
        off = sum(abs(row[3]) > TOLERANCE for row in errors)
        said, true = (f"{1e3 * depth:.3g}" for depth in worst[1:3])
        verified = f"{off} of {len(errors)} off; {said} for {true} mm at {worst[0]:.0f}"
    said = (one["failed"] or one["reason"]).replace("|", "/").replace("\n", " ")[:160]
    mark = " **unstable**" if unstable(one) else ""
    return (
        f"| {one['number']} | {hz} | {one['material']}, {one['engagement']}, {cut['teeth']} teeth | {passing} | "
        f"{advice}{mark} | {share} | {judges.replace('|', '')} | {verified} | {said} |"
    )
