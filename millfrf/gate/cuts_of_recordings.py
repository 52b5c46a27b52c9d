"""Cutting data of lobes against the cuts in which the structure was measured."""

import math
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from acquisition import Recording
from millfrf.core import InputError, listed, tables_of_setup
from millfrf.core.provenance import read_provenance
from millfrf.cutting import MillingProcess, process_from_table

from .file_kinds import FileKind, kind_of
from .settings import GATE

# keys of a cutting file, with their fields of the process: of the cutter, and of the material
_CUTTER = {"teeth": "teeth", "diameter_m": "diameter", "edge_angle_deg": "edge_angle", "helix_angle_deg": "helix_angle"}
_MATERIAL = {"ktc_pa": "ktc", "krc": "krc", "kac": "kac"}


def recorded_cuts(paths: Iterable[str | os.PathLike[str]]) -> dict[str, dict[str, Any]]:
    """Return the cutting data of the recordings from which a result is made, by the names of the recordings.

    Parameters
    ----------
    paths
        Recordings, whose set-ups state their cut, or FRFs and models, whose provenance holds the cuts of their
        recordings.
    """
    cuts: dict[str, dict[str, Any]] = {}
    for path in paths:
        if kind_of(path) == FileKind.RECORDING:
            with Recording(path) as recording:
                table = tables_of_setup(recording.setup).get("cutting")
            stored = {} if table is None else {Path(path).name: table}
        else:
            stored = read_provenance(path).get("cuts", {})
        cuts |= stored if isinstance(stored, dict) else {}
    return cuts


def check_recorded_cuts(process: MillingProcess, name: str, cuts: Mapping[str, Any]) -> list[str]:
    """Compare cutting data with those of the cuts in which the structure was measured, and return warnings.

    Another cutter has another FRF at its tip. Coefficients are the same within two of their standard errors, or within
    the share of the tangential force that shifts a limit by as much.

    Parameters
    ----------
    process, name
        Cutting data, and the name of their file.
    cuts
        What :func:`recorded_cuts` returned.
    """
    files: dict[tuple[str, str, str], list[str]] = {}
    for file, table in cuts.items():
        try:
            stated = process_from_table(table, file)
        except InputError:
            continue  # a set-up may state less than a cutting file must
        for keys, remedy in (
            (_CUTTER, "another cutter has another FRF at its tip: correct one of them"),
            (_MATERIAL, "correct one of them, unless this cut is in another material"),
        ):
            if keys is _MATERIAL and process.chip_law != stated.chip_law:
                continue  # coefficients at different chips do not compare
            wrong = [key for key, field in keys.items() if key in table and _differs(process, stated, field)]
            if wrong:
                here, there = (_values(each, {key: keys[key] for key in wrong}) for each in (process, stated))
                files.setdefault((here, there, remedy), []).append(file)
    return [
        f"{name} has {here}, but {listed(names)}, from which the structure comes, {_state(names)} {there}; {remedy}"
        for (here, there, remedy), names in files.items()
    ]


def _state(names: Sequence[str]) -> str:
    return "states" if len(names) == 1 else "state"


def _differs(process: MillingProcess, stated: MillingProcess, field: str) -> bool:
    here, there = float(getattr(process, field)), float(getattr(stated, field))
    if field in _CUTTER.values():
        return not math.isclose(here, there, rel_tol=1e-6, abs_tol=1e-9)
    tangential = process.ktc if field == "ktc" else 1.0
    return abs(here - there) > max(GATE.delay_angle * tangential, 2 * float(getattr(process, f"{field}_std")))


def _values(process: MillingProcess, keys: Mapping[str, str]) -> str:
    values = {key: float(getattr(process, field)) for key, field in keys.items()}
    return ", ".join(
        f"{key} = {math.degrees(value) if key.endswith('_deg') else value:.6g}" for key, value in values.items()
    )
