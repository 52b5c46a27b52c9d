"""Ways to spoil good files as a laboratory does: each function takes the folder and the words of the table."""

from spoil_exports import analyser, exported, records
from spoil_recordings import (
    channel,
    column,
    full_scale,
    held,
    missing,
    rate,
    shortened,
    swapped,
    truncated,
    unclosed,
    unplaced,
    without,
    without_full_scale,
    without_setup,
)
from spoil_results import estimated, fitted, frf, lobes, model
from spoil_robots import rail, robot
from spoil_texts import copy, cut, empty, pdf, plan, renamed, subfolder, text, timed, toml

__all__ = [
    "analyser",
    "channel",
    "column",
    "copy",
    "cut",
    "empty",
    "estimated",
    "exported",
    "fitted",
    "frf",
    "full_scale",
    "held",
    "lobes",
    "missing",
    "model",
    "pdf",
    "plan",
    "rail",
    "rate",
    "records",
    "renamed",
    "robot",
    "shortened",
    "subfolder",
    "swapped",
    "text",
    "timed",
    "toml",
    "truncated",
    "unclosed",
    "unplaced",
    "without",
    "without_full_scale",
    "without_setup",
]
