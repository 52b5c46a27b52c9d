"""The table of mode shapes: how real each is and which other mode it resembles."""

import numpy as np

from modal_fit import ModalModel, ModeShapes, mode_shapes

from .result_tables import Table


def shapes_of(model: ModalModel) -> ModeShapes | None:
    """The shapes of a model; None where it has no mode, or a single degree of freedom on either side."""
    if not len(model.poles) or max(len(model.responses), len(model.excitations)) < 2:
        return None
    return mode_shapes(model)


def shape_table(model: ModalModel, title: str = "Mode shapes") -> Table | None:
    """MPC, MPD, complexity and the most alike other mode; None where there is no shape."""
    shapes = shapes_of(model)
    if shapes is None:
        return None
    rows = []
    for mode, frequency in enumerate(model.natural_frequencies):
        other = shapes.most_alike(mode)
        rows.append(
            (
                str(mode + 1),
                f"{frequency:.2f}",
                f"{shapes.collinearity[mode]:.3f}",
                f"{np.degrees(shapes.deviation[mode]):.1f}",
                f"{100 * shapes.complexity[mode]:.1f}",
                "" if other is None else f"{other[1]:.2f} with mode {other[0] + 1}",
            )
        )
    columns = ("mode", "frequency (Hz)", "MPC", "MPD (°)", "complexity (%)", "largest MAC")
    return Table(f"{title} ({shapes.side} vectors, {len(shapes.dofs)} points)", columns, tuple(rows))
