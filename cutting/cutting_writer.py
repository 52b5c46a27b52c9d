"""Writing cutting files: the table ``[cutting]`` that :func:`cutting.read_cutting_process` reads."""

import math
import os
from collections.abc import Sequence

from foundation import writing_whole_file

from .milling_process import MillingProcess


def write_cutting_process(path: str | os.PathLike[str], process: MillingProcess, comments: Sequence[str] = ()) -> None:
    """Write a process to a cutting file; the engagement is written as its two angles.

    Parameters
    ----------
    path
        Cutting file to write, such as ``CUT.toml``.
    process
        Cutter, engagement and coefficients.
    comments
        Lines of comment for the head of the file.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    rows = [f"# {line}" for line in comments]
    rows += ["[cutting]", *(f"{key} = {value}" for key, value in _entries(process).items())]
    with writing_whole_file(path) as temporary:
        temporary.write_text("\n".join(rows) + "\n", encoding="utf-8")


def _entries(process: MillingProcess) -> dict[str, str]:
    always = {
        "teeth": str(process.teeth),
        "diameter_m": repr(float(process.diameter)),
        "edge_angle_deg": _degrees(process.edge_angle),
        "ktc_pa": repr(float(process.ktc)),
        "krc": repr(float(process.krc)),
        "kac": repr(float(process.kac)),
        "start_angle_deg": _degrees(process.start_angle),
        "exit_angle_deg": _degrees(process.exit_angle),
        "feed_per_tooth_m": repr(float(process.feed_per_tooth)),
    }
    where_any = {
        "kte_n_per_m": process.kte,
        "kre_n_per_m": process.kre,
        "kae_n_per_m": process.kae,
        "runout_m": process.runout,
        "process_damping_n_per_m": process.process_damping,
        "ktc_std_pa": process.ktc_std,
        "krc_std": process.krc_std,
        "kac_std": process.kac_std,
    }
    entries = always | {key: repr(float(value)) for key, value in where_any.items() if value}
    if process.helix_angle:
        entries["helix_angle_deg"] = _degrees(process.helix_angle)
    if process.pitch_angles:
        entries["pitch_angles_deg"] = "[" + ", ".join(_degrees(angle) for angle in process.pitch_angles) + "]"
    return entries


def _degrees(angle: float) -> str:
    """Rounded where a conversion to and from radians would not come back."""
    return repr(round(math.degrees(angle), 9))
