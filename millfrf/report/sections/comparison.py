"""The section that lays models of the same degrees of freedom side by side: two methods, or two amplitudes."""

import numpy as np

from modal_fit import ModalModel, ModePair, compare_modes

from ...tables.result_tables import Table, with_error
from ..collection import Collected, SourceFile
from ..section import Section


def comparison_section(collected: Collected) -> Section:
    """Each further model against the first of the same degrees of freedom, mode by mode."""
    tables, sentences = [], []
    fitted = [pair for pair in collected.models if pair[0].provenance.get("step") == "fit"]
    for number, (file, model) in enumerate(fitted):
        alike = [pair for pair in fitted[:number] if _same_axes(pair[1], model)]
        if not alike:
            continue
        base_file, base = alike[0]
        pairs = compare_modes(base, model)
        tables.append(_table(base_file, base, file, model, pairs))
        sentences.append(_summary(base_file, base, file, pairs))
    return Section("Models compared", tuple(sentences), tuple(tables))


def _same_axes(first: ModalModel, second: ModalModel) -> bool:
    return (first.responses, first.excitations, first.unit) == (second.responses, second.excitations, second.unit)


def _table(
    base_file: SourceFile, base: ModalModel, file: SourceFile, model: ModalModel, pairs: tuple[ModePair, ...]
) -> Table:
    rows = []
    for pair in pairs:
        zeta = base.damping_ratios[pair.first]
        rows.append(
            (
                str(pair.first + 1),
                f"{base.natural_frequencies[pair.first]:.3f}",
                with_error(pair.frequency_change, 2 * pair.frequency_error, sign=True),
                f"{100 * zeta:.3f}",
                with_error(100 * pair.damping_change, 200 * pair.damping_error, sign=True),
                f"{pair.right_likeness:.3f} / {pair.left_likeness:.3f}",
                "moved" if pair.moved else "",
            )
        )
    columns = ("mode", "fn (Hz)", "change (Hz)", "zeta (%)", "change (%)", "MAC right / left", "")
    title = f"{base_file.path.name}, and what changed in {file.path.name} (± 2 standard errors)"
    return Table(title, columns, tuple(rows))


def _summary(base_file: SourceFile, base: ModalModel, file: SourceFile, pairs: tuple[ModePair, ...]) -> str:
    moved = [pair for pair in pairs if pair.moved]
    text = f"{file.path.name} against {base_file.path.name}: {len(pairs)} modes in common"
    alone = len(base.poles) - len(pairs)
    text += f", {alone} without a partner" if alone else ""
    if np.isnan([pair.frequency_error for pair in pairs]).any():
        return text + "; a model has no error bars, so that no change can be judged."
    if not moved:
        return text + "; none moved by more than three standard errors of the change."
    names = ", ".join(f"{base.natural_frequencies[pair.first]:.2f} Hz" for pair in moved[:8])
    more = f" and {len(moved) - 8} more" if len(moved) > 8 else ""
    largest = max(pair.significance for pair in moved)
    return text + (
        f"; moved by more than three standard errors: {names}{more} (at most {largest:.0f} standard errors). "
        "Where both come from the same recordings this is a bias of one method; where amplitudes differ, the "
        "structure is not linear."
    )
