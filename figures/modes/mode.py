"""Modal vectors in the complex plane: right (shape) beside left (participation), which differ in a robot."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from numpy.typing import NDArray

from modal_fit import ModalModel

from ..style import COLOURS, LINE_STYLES, house_style, legend_above, new_figure

MOST_MODES = 4


def mode_figure(model: ModalModel) -> Figure:
    """Each vector turned and scaled so that its largest component is real and 1; the first four modes."""
    n_modes = min(len(model.poles), MOST_MODES)
    with house_style():
        beside = n_modes <= 2
        figure = new_figure(66.0 if beside else 112.0)
        shape = (1, 2 * max(n_modes, 1)) if beside else (2, n_modes)
        panels = figure.subplots(*shape, squeeze=False, subplot_kw={"projection": "polar"})
        for mode in range(n_modes):
            right, left = (panels[0, 2 * mode], panels[0, 2 * mode + 1]) if beside else panels[:, mode]
            heading = f"Mode {mode + 1}, {model.natural_frequencies[mode]:.2f} Hz\n"
            _draw(right, model.right[mode], model.responses)
            _draw(left, model.left[mode], model.excitations)
            right.set_title(f"{heading}right (responses)", pad=12)
            left.set_title(f"{heading if beside else ''}left (excitations)", pad=12)
        legend_above(figure, panels[0, 0])
    return figure


def _draw(axes: PolarAxes, vector: NDArray[np.complex128], labels: tuple[str, ...]) -> None:
    largest = vector[np.argmax(np.abs(vector))]
    scaled = vector / largest if largest != 0 else vector
    one_node = len({label.split(":")[0] for label in labels}) == 1
    for number, (component, label) in enumerate(zip(scaled, labels, strict=True)):
        style = {"color": COLOURS[number % len(COLOURS)], "linestyle": LINE_STYLES[number % len(LINE_STYLES)]}
        axes.plot(
            [0, np.angle(component)],
            [0, np.abs(component)],
            marker="o",
            markevery=[1],
            markersize=3.5,
            label=label.split(":")[-1] if one_node else label,
            **style,
        )
    axes.set_ylim(0, 1.1)
    axes.set_yticks([0.5, 1.0])
    axes.set_yticklabels(["0.5", ""])
    axes.set_rlabel_position(315)
    axes.set_xticks(np.radians([0, 90, 180, 270]), ["0°", "", "180°", "270°"])  # the title stands at 90°
