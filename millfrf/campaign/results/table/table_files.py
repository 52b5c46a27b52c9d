"""The table of modes as ``modes.csv`` and ``modes.parquet``: equal content, origin inside, the same bytes again."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from millfrf.core import optional_library, warning_lines, writing_whole_file

from .rows_of_modes import Cell

PURPOSE, EXTRA = "the table of a campaign", "cluster"

WHOLE_NUMBERS = ("mode_of_set", "mode")
"""Columns of whole numbers, empty where a set has no mode or a mode could not be told."""

WORDS = (
    "set",
    "pose",
    "recorded_at",
    "mode_doubt",
    "depth_limit_status",
    "verdict",
    "recordings",
    "doubts",
    "failures",
)
"""Columns of text; labels are text where one of their values is, and every other column holds numbers."""


def write_mode_tables(
    folder: Path, rows: Sequence[Mapping[str, Cell]], provenance: Mapping[str, Any], warnings: Sequence[str]
) -> None:
    """Write both files into a folder.

    Parameters
    ----------
    folder
        Folder of the files; older ones are replaced.
    rows
        Rows with equal columns, see :func:`mode_rows`.
    provenance
        Origin of the table; the line ``# provenance:`` of the CSV, and ``millfrf.provenance`` in the Parquet's schema.
    warnings
        Doubts about the whole table; lines ``# warning:`` and ``millfrf.warnings``.

    Raises
    ------
    InputError
        pandas or pyarrow are not installed, or the folder cannot be written to.
    """
    pd = optional_library("pandas", PURPOSE, EXTRA)
    arrow = optional_library("pyarrow", PURPOSE, EXTRA)
    parquet = optional_library("pyarrow.parquet", PURPOSE, EXTRA)
    frame = _typed(pd.DataFrame(list(rows), columns=list(rows[0]) if rows else ["set"]))
    with (
        writing_whole_file(folder / "modes.csv") as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        file.writelines(warning_lines(warnings))
        file.write(f"# provenance: {json.dumps(dict(provenance))}\n")
        frame.to_csv(file, index=False, float_format="%.10g", lineterminator="\n")
    table = arrow.Table.from_pandas(frame, preserve_index=False)
    stated = {
        "millfrf.format": "millfrf.modes 1",
        "millfrf.provenance": json.dumps(dict(provenance)),
        "millfrf.warnings": json.dumps(list(warnings)),
    }
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), **stated})
    with writing_whole_file(folder / "modes.parquet") as temporary:
        parquet.write_table(table, temporary)


def _typed(frame: Any) -> Any:
    """Give each column one type: whole numbers, numbers, or text."""
    for name in frame.columns:
        values = [value for value in frame[name] if value is not None]
        if name in WHOLE_NUMBERS:
            frame[name] = frame[name].astype("Int64")
        elif name in WORDS or any(isinstance(value, str) for value in values):
            frame[name] = ["" if value is None else _as_text(value) for value in frame[name]]
        else:
            frame[name] = frame[name].astype("float64")
    return frame


def _as_text(value: Cell) -> str:
    """A label as text, where one value of its column is; a missing one is empty."""
    if isinstance(value, float):
        return "" if value != value else f"{value:.10g}"
    return str(value)
