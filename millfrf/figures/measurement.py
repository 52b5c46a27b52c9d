"""Figures of recordings, their spectra, independence of inputs, and reciprocity."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from acquisition import Channel, Stream
from estimation import CrossSpectra, ReciprocityPair, input_coherence, input_independence, sum_tests
from millfrf.core import InputError

from .style import (
    COLOURS,
    FITTED,
    SHADE,
    WIDTH_MM,
    given_or_new,
    house_style,
    legend_beside,
    line_style,
    new_figure,
    panel_letter,
)


def input_figure(tests: Sequence[CrossSpectra], band: tuple[float, float]) -> Figure:
    """Draw power spectra and coherence of the inputs, and singular values of their spectral matrix S_ff.

    Parameters
    ----------
    tests
        Spectra of each test; they are stacked by :func:`estimation.sum_tests`.
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


def _in_band(spectra: CrossSpectra, band: tuple[float, float]) -> NDArray[np.bool_]:
    f = spectra.frequencies
    return np.asarray((f >= band[0]) & (f <= band[1]))


def _draw_spectra(axes: Axes, total: CrossSpectra, band: tuple[float, float]) -> None:
    in_band = _in_band(total, band)
    for number, channel in enumerate(total.excitations):
        power = np.real(total.input_spectra[in_band, number, number])
        axes.semilogy(total.frequencies[in_band], power, label=channel.degree_of_freedom, **line_style(number))
    axes.set_ylabel(f"Input power\n({_power_unit(total)})")


def _draw_singular_values(
    axes: Axes, total: CrossSpectra, tests: Sequence[CrossSpectra], band: tuple[float, float]
) -> None:
    in_band = _in_band(total, band)
    values = input_independence(total).singular_values[in_band]
    axes.set_yscale("log")
    for number in range(values.shape[1]):
        label = f"σ{_subscript(number + 1)} stacked"
        axes.plot(total.frequencies[in_band], values[:, number], label=label, **line_style(number))
    single = [input_independence(test).singular_values[in_band, -1] for test in tests]
    for number, smallest in enumerate(single):
        name = f"σ{_subscript(values.shape[1])} of one test" if number == 0 else None
        axes.plot(total.frequencies[in_band], smallest, color="#7f7f7f", linewidth=0.6, label=name)
    shown = np.concatenate([values.ravel(), *single])
    shown = shown[shown > 0]
    if len(shown):
        axes.set_ylim(max(float(np.percentile(shown, 1)) / 3, float(shown.max()) * 1e-12), float(shown.max()) * 5)
    axes.set_ylabel(f"Singular values of\n$S_{{ff}}$ ({_power_unit(total)})")


def _draw_coherence(axes: Axes, total: CrossSpectra) -> None:
    coherence = input_coherence(total)
    pairs = [(m, n) for m in range(coherence.shape[1]) for n in range(m)]
    for number, (m, n) in enumerate(pairs):
        label = f"{total.excitations[n].name} – {total.excitations[m].name}"
        axes.plot(total.frequencies, coherence[:, n, m], label=label, **line_style(number))
    if not pairs:
        axes.plot(total.frequencies, np.ones(len(total.frequencies)), label="one input", **line_style(0))
    axes.set_ylim(0, 1.05)
    axes.set_ylabel("Coherence\nbetween inputs (1)")


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


_COLUMNS = 3
_ROW, _TOP, _LEFT, _GAP = 58.0, 3.0, 17.0, 5.0
_MAGNITUDE, _DIFFERENCE = (6.0, 26.0), (34.0, 13.0)  # top edge and height within a row, mm


def reciprocity_figure(pairs: Sequence[ReciprocityPair], unit: str) -> Figure:
    """Draw pairs of FRFs that are equal if reciprocity holds, three pairs per row.

    Parameters
    ----------
    pairs
        Pairs to draw, about six at most.
    unit
        Unit of the FRF.
    """
    rows = -(-len(pairs) // _COLUMNS)
    height = _TOP + rows * _ROW
    values = np.concatenate([np.abs(np.append(pair.forth, pair.back)) for pair in pairs])
    limits = 0.7 * values[values > 0].min(initial=values.max()), 1.5 * values.max()
    with house_style():
        figure = new_figure(height, None)
        for number, pair in enumerate(pairs):
            row, column = divmod(number, _COLUMNS)
            width = (WIDTH_MM - _LEFT - 5 - _GAP * (_COLUMNS - 1)) / _COLUMNS
            left = _LEFT + column * (width + _GAP)
            panels = []
            for top, tall in (_MAGNITUDE, _DIFFERENCE):
                bottom = height - _TOP - row * _ROW - top - tall
                corner = (left / WIDTH_MM, bottom / height, width / WIDTH_MM, tall / height)
                panels.append(figure.add_axes(corner))
            _draw_pair(panels[0], panels[1], pair, unit, outer=column == 0)
            panels[0].set_ylim(max(limits[0], 1e-5 * limits[1]), limits[1])
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="upper center", ncols=2, borderaxespad=0.1)
    return figure


def _draw_pair(magnitude: Axes, difference: Axes, pair: ReciprocityPair, unit: str, *, outer: bool) -> None:
    magnitude.semilogy(pair.frequencies, abs(pair.forth), color="#000000", linewidth=0.9, label="p / q")
    magnitude.semilogy(
        pair.frequencies, abs(pair.back), color=FITTED, linewidth=0.9, linestyle=(0, (5, 1.5)), label="q / p"
    )
    difference.plot(pair.frequencies, 100 * pair.difference_over_frequency, color="#000000", linewidth=0.8)
    magnitude.set_title(f"{pair.first} / {pair.second}", pad=3)
    magnitude.tick_params(labelbottom=False, labelleft=outer)
    difference.set_ylim(0, 205)
    difference.set_yticks([0, 100, 200])
    difference.tick_params(labelleft=outer)
    difference.set_xlabel("Frequency (Hz)")
    difference.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    magnitude.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    for axes in (magnitude, difference):
        axes.set_xlim(pair.frequencies[0], pair.frequencies[-1])
    if outer:
        magnitude.set_ylabel(f"|H| ({unit})")
        difference.set_ylabel("Diff. (%)")


MAX_CHANNELS = 9  # channels that are drawn where none is named


def time_figure(stream: Stream, *, zoom_seconds: float = 0.25, channels: Sequence[str] | None = None) -> Figure:
    """Draw for each channel the envelope (extreme samples of each bin) left and ``zoom_seconds`` of samples right.

    The recording is read once, block by block. Only the first nine channels are drawn.
    """
    shown = tuple(c for c in stream.channels if channels is None or c.name in channels)[:MAX_CHANNELS]
    names = [channel.name for channel in shown]
    edges, low, high = envelope(stream, names)
    middle = stream.n_samples // 2
    stop = min(stream.n_samples, middle + max(2, round(zoom_seconds * stream.sample_rate)))
    close = stream.read(middle, stop, names)
    time = stream.start_time + np.arange(middle, stop) / stream.sample_rate
    with house_style():
        height = 19.0 * len(shown) + 17.0
        figure = new_figure(height, None)
        margins = {"left": 0.095, "right": 0.99, "wspace": 0.16, "hspace": 0.22, "top": 1 - 6 / height}
        grid = figure.add_gridspec(len(shown), 2, width_ratios=[1.7, 1.0], bottom=11 / height, **margins)
        panels = grid.subplots(squeeze=False, sharex="col")
        for row, channel in enumerate(shown):
            _label_row(panels[row, 0], panels[row, 1], channel)
            panels[row, 0].fill_between(edges, low[:, row], high[:, row], color=_colour(channel), linewidth=0.2)
            panels[row, 1].plot(time, close[:, row], color=_colour(channel), linewidth=0.7)
        for column in (0, 1):
            panels[-1, column].set_xlabel("Time (s)")
        panels[0, 0].set_title("Whole recording (envelope)", pad=3)
        panels[0, 1].set_title("A closer look", pad=3)
        panels[0, 0].set_xlim(edges[0], edges[-1])
        panels[0, 1].set_xlim(time[0], time[-1])
        figure.align_ylabels(panels[:, 0])
    return figure


def envelope(
    stream: Stream, names: Sequence[str], bins: int = 600
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the time of each bin (s), and the smallest and the largest sample of each bin and channel."""
    length = max(1, -(-stream.n_samples // bins))
    low, high = [], []
    for block in stream.blocks(length * max(1, (1 << 16) // length), names):
        for start in range(0, len(block), length):
            samples = block[start : start + length]
            low.append(samples.min(axis=0))
            high.append(samples.max(axis=0))
    time = stream.start_time + (np.arange(len(low)) + 0.5) * length / stream.sample_rate
    return np.asarray(time, dtype=np.float64), np.array(low), np.array(high)


def _label_row(overview: Axes, close: Axes, channel: Channel) -> None:
    overview.set_ylabel(f"{channel.name}\n({channel.unit.replace('^2', '²')})")
    for axes in (overview, close):
        axes.locator_params(axis="y", nbins=3)
    close.tick_params(labelleft=True)


def _colour(channel: Channel) -> str:
    kinds = ("force", "acceleration", "displacement", "voltage", "velocity")
    return COLOURS[1 + kinds.index(channel.quantity)] if channel.quantity in kinds else COLOURS[0]


def draw_stream(stream: Stream, axes: Axes | None = None, *, channels: Sequence[str] | None = None) -> Axes:
    """Draw the envelope of each channel over time (extreme samples of each bin), one row per channel.

    Each row is scaled by the largest deviation from its mean, which is written beside it with its unit. The recording
    is read once, block by block.

    Parameters
    ----------
    stream
        Samples of one clock.
    axes
        Axes to draw into; None: new ones.
    channels
        Names of the channels to draw; None: all, of more than nine the first nine.

    Raises
    ------
    InputError
        A channel that does not exist.
    """
    names = [c.name for c in stream.channels][:MAX_CHANNELS] if channels is None else list(channels)
    shown = [stream.channels[column] for column in stream.columns(names)]
    time, low, high = envelope(stream, names)
    middle = (low.mean(axis=0) + high.mean(axis=0)) / 2
    largest = np.maximum(np.abs(low - middle), np.abs(high - middle)).max(axis=0)
    scale = np.where(largest > 0, largest, 1.0)
    rows = -np.arange(len(names), dtype=float)
    with given_or_new(axes, 14.0 * len(names) + 18.0) as drawn:
        for row, y in enumerate(rows):
            edges = (y + 0.45 * (signal[:, row] - middle[row]) / scale[row] for signal in (low, high))
            drawn.fill_between(time, *edges, color=COLOURS[1], linewidth=0.3)
        levels = [
            f"{channel.name}\n± {size:.3g} {channel.unit.replace('^2', '²')}"
            for channel, size in zip(shown, largest, strict=True)
        ]
        drawn.set_yticks(rows, levels)
        drawn.set_ylim(rows[-1] - 0.6, 0.6)
        drawn.set_xlim(time[0], time[-1])
        drawn.set_xlabel("Time (s)")
    return drawn


def draw_spectra(spectra: CrossSpectra, axes: Axes | None = None, *, side: str = "excitations") -> Axes:
    """Draw the power spectral density of each excitation or of each response, on a logarithmic axis.

    Parameters
    ----------
    spectra
        Cross spectra of one test or of several.
    axes
        Axes to draw into; None: new ones.
    side
        ``excitations`` or ``responses``.

    Raises
    ------
    InputError
        An unknown side.
    """
    if side not in ("excitations", "responses"):
        raise InputError(f"unknown side {side!r} of spectra; use one of excitations, responses")
    channels = spectra.excitations if side == "excitations" else spectra.responses
    matrix = spectra.input_spectra if side == "excitations" else spectra.output_spectra
    power = np.real(np.einsum("kii->ki", matrix))
    units = list(dict.fromkeys(channel.unit for channel in channels))
    one_unit = f"(({units[0]})²/Hz)" if "/" in units[0] else f"({units[0]}²/Hz)"
    with given_or_new(axes) as shown:
        for number, channel in enumerate(channels):
            label = channel.name if len(units) == 1 else f"{channel.name} ({channel.unit})²/Hz"
            drawn = np.where(power[:, number] > 0, power[:, number], np.nan)
            shown.plot(spectra.frequencies, drawn, label=label, **line_style(number))
        shown.set_yscale("log")
        shown.set_xlabel("Frequency (Hz)")
        shown.set_ylabel(f"Power spectral density {one_unit.replace('^2', '²') if len(units) == 1 else '(unit²/Hz)'}")
        if axes is None:
            shown.set_xlim(spectra.frequencies[0], spectra.frequencies[-1])
        legend_beside(shown)
    return shown
