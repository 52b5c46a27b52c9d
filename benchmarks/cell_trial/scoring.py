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
    advised = [cell for cell in results if cell.get("advice") is not None]
    bad = [cell["number"] for cell in results if unstable(cell)]
    drifting = [cell["number"] for cell in advised if not unstable(cell) and max(cell["drifted"]) > 1]
    shares = [cell["share_of_best"] for cell in advised]
    errors = {cell["number"]: [row[3] for row in verified_errors(cell)] for cell in results}
    every = np.array([error for rows in errors.values() for error in rows])
    off = [number for number, rows in errors.items() if any(abs(error) > TOLERANCE for error in rows)]
    failed = [cell["number"] for cell in results if cell.get("failed") or cell.get("crashed")]
    silent = [
        cell["number"]
        for cell in results
        if cell.get("advice") is None and not cell.get("reason") and not cell.get("failed")
    ]
    seconds = [cell["all_seconds"] for cell in results if "all_seconds" in cell]
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


def _row(cell: dict[str, Any]) -> str:
    if "crashed" in cell:
        return f"| {cell['number']} | | | | | | | | trial crashed: {cell['crashed'].strip().splitlines()[-1]} |"
    hz = "; ".join(" ".join(f"{f:.1f}" for f in cell[key]) or "-" for key in ("modes_hz", "outside_hz", "hidden_hz"))
    cut = cell["cut"]
    passing = " to ".join(f"{speed * cut['teeth'] / 60:.0f}" for speed in cell["speeds_rpm"])
    advice = share = judges = "-"
    if cell["advice"] is not None:
        speed, depth = cell["advice"]
        advice, share = f"{1e3 * depth:.3g} mm at {speed:.0f}", _percent(cell["share_of_best"])
        judges = f"|mu| {cell['radius']:.3f}, limit {1e3 * cell['true_limit']:.3g} mm, time {cell['in_time']['stable']}"
    errors = verified_errors(cell)
    worst = max(errors, key=lambda row: abs(row[3]), default=None)
    verified = "none"
    if worst is not None:
        off = sum(abs(row[3]) > TOLERANCE for row in errors)
        said, true = (f"{1e3 * depth:.3g}" for depth in worst[1:3])
        verified = f"{off} of {len(errors)} off; {said} for {true} mm at {worst[0]:.0f}"
    said = (cell["failed"] or cell["reason"]).replace("|", "/").replace("\n", " ")[:160]
    mark = " **unstable**" if unstable(cell) else ""
    return (
        f"| {cell['number']} | {hz} | {cell['material']}, {cell['engagement']}, {cut['teeth']} teeth | {passing} | "
        f"{advice}{mark} | {share} | {judges.replace('|', '')} | {verified} | {said} |"
    )
