"""The one way up: a result's ``plot()`` reaches the room ``figures``, which stands above the rooms of the results.

All other imports point downwards. The import linter lists this file as the only exception (docs/decisions/0018).
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def drawing(name: str) -> "Callable[..., Axes]":
    """The function of ``figures`` that draws one type of result into axes; matplotlib is loaded here, not before.

    Parameters
    ----------
    name
        Name of the function, such as ``draw_frf``.
    """
    import figures

    return cast("Callable[..., Axes]", getattr(figures, name))
