"""What a fit says of itself: its model in short, how good it is, and the first doubt."""

from collections.abc import Sequence

from foundation import Summary, counted, doubts_line, listed

from .modal_model import ModalModel, modes_in_short


def fit_summary(name: str, model: ModalModel, notes: Sequence[str], warnings: Sequence[str]) -> Summary:
    """Summary of a result that holds a model.

    Parameters
    ----------
    name
        Name of the result's type.
    model
        Modal model that was found.
    notes
        At most one line on how good it is.
    warnings
        Doubts about the model, one sentence each.
    """
    modes = modes_in_short(model.natural_frequencies, 100 * model.damping_ratios)
    table = model._summary()
    headline = f"{name}: {counted(len(modes), 'mode')}, {model.quantity} in {model.unit}"
    lines = (f"modes {listed(modes) or 'none'}", *notes, *doubts_line(warnings))
    return Summary(headline, lines, table.columns, table.rows)
