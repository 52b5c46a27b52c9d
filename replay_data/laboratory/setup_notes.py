"""The set-up of a simulated test as TOML text: what a laboratory notes down, never the structure's truth."""

import json
import math
from collections.abc import Mapping, Sequence

from cutting import MillingProcess

Plain = str | float | bool | Sequence[float]
"""What a set-up may say of one thing: a word, a number, yes or no, or a row of numbers."""


def setup_text(tables: Mapping[str, Mapping[str, Plain]]) -> str:
    """TOML text of tables of plain values.

    Examples
    --------
    >>> print(setup_text({"cut": {"depth_m": 0.002, "material": "porous"}}), end="")
    [cut]
    depth_m = 0.002
    material = "porous"
    """
    lines = []
    for table, entries in tables.items():
        lines += [f"[{table}]", *(f"{key} = {_toml_value(value)}" for key, value in entries.items()), ""]
    return "\n".join(lines[:-1]) + "\n" if lines else ""


def cutting_table(process: MillingProcess) -> dict[str, str | float]:
    """The process under the keys of a cutting file, so that the set-up can be read as one."""
    entries: dict[str, str | float] = {
        "teeth": process.teeth,
        "diameter_m": process.diameter,
        "edge_angle_deg": _degrees(process.edge_angle),
        "ktc_pa": process.ktc,
        "krc": process.krc,
        "kac": process.kac,
        "start_angle_deg": _degrees(process.start_angle),
        "exit_angle_deg": _degrees(process.exit_angle),
        "feed_per_tooth_m": process.feed_per_tooth,
    }
    optional = {
        "kte_n_per_m": process.kte,
        "kre_n_per_m": process.kre,
        "kae_n_per_m": process.kae,
        "runout_m": process.runout,
    }
    return entries | {key: value for key, value in optional.items() if value}


def _degrees(angle: float) -> float:
    return round(math.degrees(angle), 9)


def _toml_value(value: Plain) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Sequence):
        return f"[{', '.join(_toml_value(part) for part in value)}]"
    return repr(int(value)) if isinstance(value, int) else repr(float(value))
