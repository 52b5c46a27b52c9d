"""Figures of modal models: vectors, stabilisation charts, indicators, synthesis."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.projections.polar import PolarAxes
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError
from modal_fit import ComplexModeIndicator, ModalModel, MultivariateModeIndicator, StabilisationChart, Synthesis

from .frf import draw_frf
from .style import (
    COLOURS,
    FITTED,
    LINE_STYLES,
    MEASURED,
    TRUE,
    given_or_new,
    house_style,
    legend_above,
    new_figure,
    panel_letter,
)

_CURVES = ("first curve", "second curve", "third curve")


def indicator_figure(
    complex_indicator: ComplexModeIndicator, multivariate: MultivariateModeIndicator, model: ModalModel | None = None
) -> Figure:
    """Draw three singular values above, and three eigenvalues of the multivariate mode indicator below.

    Parameters
    ----------
    complex_indicator, multivariate
        Complex and multivariate mode indicators of one FRF in one band.
    model
        Modal model whose natural frequencies are marked.
    """
    with house_style():
        figure = new_figure(110.0)
        sizes, shares = figure.subplots(2, 1, sharex=True, height_ratios=[1.5, 1.0])
        for curve in range(min(len(_CURVES), complex_indicator.singular_values.shape[1])):
            values = complex_indicator.singular_values[:, curve]
            sizes.semilogy(complex_indicator.frequencies, values, label=_CURVES[curve], **_line(curve))
        for curve in range(min(len(_CURVES), multivariate.values.shape[1])):
            shares.plot(multivariate.frequencies, multivariate.values[:, curve], **_line(curve))
        if model is not None:
            _mark(sizes, shares, model)
        sizes.set_ylabel(f"CMIF ({complex_indicator.unit})")
        shares.set_ylabel("MIF (1)")
        shares.set_ylim(0, 1.02)
        shares.set_xlabel("Frequency (Hz)")
        shares.set_xlim(complex_indicator.frequencies[0], complex_indicator.frequencies[-1])
        panel_letter(sizes, 0)
        panel_letter(shares, 1)
        legend_above(figure, sizes)
    return figure


def _line(curve: int) -> dict[str, object]:
    return {"color": COLOURS[curve if curve < 2 else 3], "linestyle": LINE_STYLES[curve], "linewidth": 1.1}


def _mark(sizes: Axes, shares: Axes, model: ModalModel) -> None:
    """Draw thin lines at the natural frequencies, behind the curves."""
    for number, frequency in enumerate(model.natural_frequencies):
        for axes in (sizes, shares):
            label = "mode of the fitted model" if number == 0 and axes is sizes else None
            axes.axvline(frequency, color=FITTED, linewidth=0.8, linestyle=(0, (5, 1.5)), label=label, zorder=1)


def mode_figure(model: ModalModel) -> Figure:
    """Draw the vectors of the first four modes, scaled to a largest component of 1."""
    n_modes = min(len(model.poles), 4)
    with house_style():
        one_row = n_modes <= 2
        figure = new_figure(66.0 if one_row else 112.0)
        shape = (1, 2 * max(n_modes, 1)) if one_row else (2, n_modes)
        panels = figure.subplots(*shape, squeeze=False, subplot_kw={"projection": "polar"})
        for mode in range(n_modes):
            right, left = (panels[0, 2 * mode], panels[0, 2 * mode + 1]) if one_row else panels[:, mode]
            heading = f"Mode {mode + 1}, {model.natural_frequencies[mode]:.2f} Hz\n"
            _draw(right, model.right[mode], model.responses)
            _draw(left, model.left[mode], model.excitations)
            right.set_title(f"{heading}right (responses)", pad=12)
            left.set_title(f"{heading if one_row else ''}left (excitations)", pad=12)
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
    axes.set_xticks(np.radians([0, 90, 180, 270]), ["0°", "", "180°", "270°"])  # the title is at 90°


def draw_model(
    model: ModalModel,
    axes: Axes | None = None,
    *,
    frequencies: NDArray[np.float64] | None = None,
    response: str | None = None,
    excitation: str | None = None,
    part: str = "magnitude",
    quantity: str | None = None,
    **line: Any,
) -> Axes:
    """Draw entries of a model's FRF, with thin vertical lines at its natural frequencies in the band.

    The model is drawn in the band in which it holds. Frequencies outside, which must be asked for, are pale and dotted.

    Parameters
    ----------
    model
        Modal model of any quantity.
    axes
        Axes to draw into, such as those of a measured FRF; None: new ones.
    frequencies : (n_frequencies,), Hz
        None: those of the axes in the model's band; without axes its band, else from half the lowest natural frequency
        to one and a half times the highest.
    response, excitation, part, quantity, line
        As in ``draw_frf``.

    Raises
    ------
    InputError
        A degree of freedom or a part that does not exist.
    """
    grid = _grid(model, axes) if frequencies is None else np.asarray(frequencies, dtype=float)
    drawn_over = axes is not None and axes.has_data()
    over = {"linestyle": (0, (5, 1.5)), "color": FITTED, "linewidth": 1.4, "label": "model"} if drawn_over else {}
    with given_or_new(axes) as shown:
        low, high = model.band or (0.0, np.inf)
        natural = model.natural_frequencies
        for number, frequency in enumerate(natural[(natural >= low) & (natural <= high)]):
            label = "natural frequencies" if number == 0 and not drawn_over else None
            shown.axvline(frequency, color="#777777", linewidth=0.7, linestyle=(0, (1, 1.5)), label=label, zorder=1)
        style = {**over, **line}
        draw_frf(
            model.frf(grid), shown, response=response, excitation=excitation, part=part, quantity=quantity, **style
        )
        if axes is None:
            shown.set_xlim(grid[0], grid[-1])
    return shown


def _grid(model: ModalModel, axes: Axes | None) -> NDArray[np.float64]:
    """Return frequencies (Hz) above 0; at 0 Hz a residual inertia is infinite.

    Raises
    ------
    InputError
        Axes that show no frequency of the model's band.
    """
    natural = model.natural_frequencies if len(model.poles) else np.array([1.0])
    low, high = model.band or (0.5 * float(natural.min()), 1.5 * float(natural.max()))
    if axes is not None and axes.has_data():
        left, right = axes.get_xlim()
        low, high = (max(low, left), min(high, right)) if model.band is not None else (left, right)
        if low >= high and model.band is not None:
            raise InputError(
                f"the axes show {left:g} to {right:g} Hz, the model holds in {model.band[0]:g} to "
                f"{model.band[1]:g} Hz; draw it into other axes, or name the frequencies"
            )
    return np.linspace(max(low, 1e-3 * high), high, 1001)


_KINDS = (
    ("new pole", {"marker": ".", "color": "#a6a6a6", "markersize": 3}),
    ("stable frequency", {"marker": "+", "color": "#0072B2", "markersize": 4.5}),
    ("stable frequency and damping", {"marker": "x", "color": "#009E73", "markersize": 4.5}),
    (
        "stable frequency, damping and vector",
        {"marker": "o", "color": "#000000", "markersize": 3.6, "markerfacecolor": "none"},
    ),
)


def stabilisation_figure(chart: StabilisationChart, frf: Frf | None = None, model: ModalModel | None = None) -> Figure:
    """Draw a stabilisation chart: poles over order and over damping.

    Parameters
    ----------
    chart
        Stabilisation chart of a fit.
    frf
        FRF whose summed magnitude is drawn behind the chart.
    model
        Modal model whose natural frequencies and damping ratios are marked.
    """
    with house_style():
        figure = new_figure(125.0)
        orders, damping = figure.subplots(2, 1, sharex=True, height_ratios=[1.6, 1.0])
        if frf is not None:
            _draw_sum(orders, frf, chart.band)
        for kind, (label, style) in enumerate(_KINDS):
            chosen = chart.stability == kind
            marks = {"linestyle": "none", "markeredgewidth": 0.8, **style}
            orders.plot(chart.frequencies[chosen], chart.orders[chosen], label=label, **marks)
            if kind >= 2:
                damping.plot(chart.frequencies[chosen], 100 * chart.damping_ratios[chosen], **marks)
        if model is not None:
            _mark_modes(orders, damping, model)
        orders.set_ylabel("Model order (1)")
        orders.set_xlim(*chart.band)
        damping.set_ylabel("Damping ratio (%)")
        damping.set_xlabel("Frequency (Hz)")
        damping.set_ylim(0, _damping_limit(chart, model))
        panel_letter(orders, 0)
        panel_letter(damping, 1)
        legend_above(figure, orders, columns=3)
    return figure


def _draw_sum(orders: Axes, frf: Frf, band: tuple[float, float]) -> None:
    background = orders.twinx()
    in_band = (frf.frequencies >= band[0]) & (frf.frequencies <= band[1]) & frf.valid
    total = np.sum(np.abs(frf.values[in_band]), axis=(1, 2))
    background.semilogy(frf.frequencies[in_band], total, color="#b0b0b0", linewidth=1.6)
    background.set_ylabel(f"Σ|H| ({frf.unit})", color="#666666")
    background.grid(visible=False)
    orders.set_zorder(background.get_zorder() + 1)
    orders.patch.set_visible(False)


def _mark_modes(orders: Axes, damping: Axes, model: ModalModel) -> None:
    for number, (frequency, zeta) in enumerate(zip(model.natural_frequencies, model.damping_ratios, strict=True)):
        label = "mode of the fitted model" if number == 0 else None
        orders.axvline(frequency, color=FITTED, linewidth=1.0, linestyle=(0, (5, 1.5)), label=label)
        damping.plot(frequency, 100 * zeta, marker="D", markersize=7, color=FITTED, markerfacecolor="none")


def _damping_limit(chart: StabilisationChart, model: ModalModel | None) -> float:
    """Return the upper end of the damping axis (%): above every mode and nearly all stable poles."""
    zeta = 100 * chart.damping_ratios[chart.stability >= 2]
    top = float(np.percentile(zeta, 90)) if len(zeta) else 1.0
    if model is not None and len(model.poles):
        top = max(top, 100 * float(model.damping_ratios.max()))
    return 1.3 * top


def synthesis_figure(compared: Synthesis, unit: str) -> Figure:
    """Draw the sums of measured and synthesised magnitudes over the entries that the model contains.

    Parameters
    ----------
    compared
        FRFs of the measurement and of the model.
    unit
        Unit of both FRFs.
    """
    known = np.isfinite(compared.misfit)
    measured, modelled = compared.measured[:, known], compared.synthesised[:, known]
    with house_style():
        figure = new_figure(75.0)
        axes = figure.subplots()
        f = compared.frequencies
        axes.semilogy(f, np.abs(measured).sum(axis=1), color=MEASURED, linewidth=1.2, label="measured")
        dashed = {"color": FITTED, "linestyle": (0, (5, 1.5)), "linewidth": 1.2}
        axes.semilogy(f, np.abs(modelled).sum(axis=1), label="synthesised", **dashed)
        dotted = {"color": TRUE, "linestyle": (0, (1, 1.2)), "linewidth": 1.2}
        axes.semilogy(f, np.abs(measured - modelled).sum(axis=1), label="difference", **dotted)
        axes.set_xlim(f[0], f[-1])
        axes.set_xlabel("Frequency (Hz)")
        axes.set_ylabel(f"Σ|H| ({unit})")
        legend_above(figure, axes)
    return figure
