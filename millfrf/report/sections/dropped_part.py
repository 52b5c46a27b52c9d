"""Poles that an automatic fit did not take for modes, with the reasons, folded."""

from ...tables.result_tables import Table
from ..collection import SourceFile
from ..section import Fold


def dropped_part(file: SourceFile) -> tuple[Fold, ...]:
    """A fold with one row a group of poles; none where the model's file names none."""
    stored = file.provenance.get("dropped") if file.provenance.get("step") == "fit" else None
    if not stored:
        return ()
    rows = tuple(
        (f"{one['frequency_hz']:.2f}", f"{100 * one['damping_ratio']:.2f}", str(one["reason"]))
        for one in sorted(stored, key=_frequency)
    )
    title = f"{file.path.name}: {len(rows)} groups of poles that were not taken for modes, and why"
    return (Fold(title, tables=(Table(title, ("frequency (Hz)", "damping ratio (%)", "why"), rows),)),)


def _frequency(one: dict[str, float]) -> float:
    return one["frequency_hz"]
