"""Tables of a posture as CSV: receptance over frequency, compliance at the tool."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from estimation import Frf
from millfrf.core import warning_lines, writing_whole_file
from millfrf.robot_model import PostureResult

from ...provenance import add_comment


def write_receptance_table(path: Path, frf: Frf, warnings: Sequence[str], origin: Mapping[str, Any]) -> None:
    """CSV: ``frequency_hz``, then real and imaginary part of each entry: ``re_X_Y_m_per_n`` is X under a force in Y."""
    names = [
        f"{part}_{response.split(':')[1].lstrip('+')}_{excitation.split(':')[1].lstrip('+')}_m_per_n"
        for response in frf.responses
        for excitation in frf.excitations
        for part in ("re", "im")
    ]
    flat = frf.values.reshape(len(frf.frequencies), -1)
    rows = np.column_stack([frf.frequencies, np.stack([flat.real, flat.imag], axis=2).reshape(len(flat), -1)])
    _write(path, ["frequency_hz", *names], [[f"{value:.9g}" for value in row] for row in rows], warnings, origin)


def write_compliance_table(path: Path, result: PostureResult, origin: Mapping[str, Any]) -> None:
    """CSV: a row for each degree of freedom at the tool, a column for each force (N) and moment (N m) on it."""
    names = [label.split(":")[1].lstrip("+") for label in result.labels]
    columns = ["moves", "unit", *(f"per_{'nm' if 'R' in name else 'n'}_{name}" for name in names)]
    rows = [
        [name, "rad" if "R" in name else "m", *(f"{value:.9g}" for value in row)]
        for name, row in zip(names, result.compliance, strict=True)
    ]
    _write(path, columns, rows, result.warnings, origin)


def _write(
    path: Path,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    warnings: Sequence[str],
    origin: Mapping[str, Any],
) -> None:
    with writing_whole_file(path) as unfinished:
        with unfinished.open("w", newline="", encoding="utf-8") as stream:
            stream.writelines(warning_lines(warnings))
            writer = csv.writer(stream)
            writer.writerow(columns)
            writer.writerows(rows)
        add_comment(unfinished, origin)
