"""Were the inputs independent? Their spectra, the singular values of their matrix, and their coherence."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from estimation import CrossSpectra, input_coherence, input_independence, sum_tests

from ..style import SHADE, house_style, line_style, new_figure, panel_letter


def input_figure(tests: Sequence[CrossSpectra], band: tuple[float, float]) -> Figure:
    """Power spectra of the inputs, singular values of S_ff (all tests, and each alone), coherence between inputs.

    Parameters
    ----------
    tests
        Spectra test by test; they are stacked by :func:`estimation.sum_tests`.
    band
        Frequency axis, Hz. Lines without independent inputs are shaded.
    """
    total = sum_tests(tests)
    with house_style():
        figure = new_figure(135.0)
        spectra, singular, coherence = figure.subplots(3, 1, sharex=True, height_ratios=[1.0, 1.2, 0.8])
        _draw_spectra(spectra, total, band)
        _draw_singular_values(singular, total, tests if len(tests) > 1 else (), band)
        _draw_coherence(coherence, total)
        for number, axes in enumerate((spectra, singular, coherence)):
            panel_letter(axes, number)
            _shade_dependent(axes, total)
            axes.legend(loc="center left", bbox_to_anchor=(1.005, 0.5))
        coherence.set_xlim(*band)
        coherence.set_xlabel("Frequency (Hz)")
    return figure


def _inside(spectra: CrossSpectra, band: tuple[float, float]) -> NDArray[np.bool_]:
    f = spectra.frequencies
    return np.asarray((f >= band[0]) & (f <= band[1]))


def _draw_spectra(axes: Axes, total: CrossSpectra, band: tuple[float, float]) -> None:
    inside = _inside(total, band)
    for number, channel in enumerate(total.excitations):
        power = np.real(total.input_spectra[inside, number, number])
        axes.semilogy(total.frequencies[inside], power, label=channel.degree_of_freedom, **line_style(number))
    axes.set_ylabel(f"Input power\n({_power_unit(total)})")


def _draw_singular_values(
    axes: Axes, total: CrossSpectra, tests: Sequence[CrossSpectra], band: tuple[float, float]
) -> None:
    inside = _inside(total, band)
    values = input_independence(total).singular_values[inside]
    axes.set_yscale("log")
    for number in range(values.shape[1]):
        axes.plot(
            total.frequencies[inside],
            values[:, number],
            label=f"σ{_subscript(number + 1)} stacked",
            **line_style(number),
        )
    alone = [input_independence(test).singular_values[inside, -1] for test in tests]
    for number, smallest in enumerate(alone):
        label = f"σ{_subscript(values.shape[1])} of one test" if number == 0 else None
        axes.plot(total.frequencies[inside], smallest, color="#7f7f7f", linewidth=0.6, label=label)
    shown = np.concatenate([values.ravel(), *alone])
    shown = shown[shown > 0]
    if len(shown):
        axes.set_ylim(max(float(np.percentile(shown, 1)) / 3, float(shown.max()) * 1e-12), float(shown.max()) * 5)
    axes.set_ylabel(f"Singular values of\n$S_{{ff}}$ ({_power_unit(total)})")


def _draw_coherence(axes: Axes, total: CrossSpectra) -> None:
    coherence = input_coherence(total)
    pairs = [(m, n) for m in range(coherence.shape[1]) for n in range(m)]
    for number, (m, n) in enumerate(pairs):
        label = f"{_short(total, n)} – {_short(total, m)}"
        axes.plot(total.frequencies, coherence[:, n, m], label=label, **line_style(number))
    if not pairs:
        axes.plot(total.frequencies, np.ones(len(total.frequencies)), label="one input", **line_style(0))
    axes.set_ylim(0, 1.05)
    axes.set_ylabel("Coherence\nbetween inputs (1)")


def _short(spectra: CrossSpectra, number: int) -> str:
    """Name of an input, short enough for a pair of them to stand in a legend."""
    return spectra.excitations[number].name


def _shade_dependent(axes: Axes, total: CrossSpectra) -> None:
    independent = input_independence(total).independent
    axes.fill_between(
        total.frequencies,
        0,
        1,
        where=~independent,
        step="mid",
        transform=axes.get_xaxis_transform(),
        color=SHADE,
        linewidth=0,
        label="no FRF" if (~independent).any() else None,
        zorder=0,
    )


def _power_unit(spectra: CrossSpectra) -> str:
    units = {channel.unit for channel in spectra.excitations}
    unit = units.pop() if len(units) == 1 else "mixed units"
    return f"{unit}²/Hz"


def _subscript(number: int) -> str:
    return str(number).translate(str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉"))
