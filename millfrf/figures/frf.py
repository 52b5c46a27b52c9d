"""FRF matrix: magnitude, phase and coherence, with fit and reference."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MultipleLocator
from numpy.typing import NDArray

from estimation import FRF_ORDERS, Frf, chosen_indices, to_receptance
from millfrf.core import InputError
from modal_fit import ModalModel

from .style import FITTED, MEASURED, TRUE, WIDTH_MM, given_or_new, house_style, legend_beside, line_style, new_figure

PER_PAGE = 3  # responses, and excitations, on one page

# distances from a mode's peak, in half widths, at which its curve has points
_AROUND = np.concatenate([-np.geomspace(0.05, 30, 25)[::-1], [0.0], np.geomspace(0.05, 30, 25)])

SYMBOLS = {"receptance": "H", "mobility": "Y", "accelerance": "A"}


@dataclass(frozen=True)
class FrfCurves:
    """The FRF, models and bands that one figure shows.

    Parameters
    ----------
    measured
        Measured FRF of any quantity; the models must give the same unit.
    band : (low, high), Hz
        Limits of the frequency axis.
    fitted, reference
        Models that are drawn over the FRF; None: not drawn.
    fit_band : Hz
        Band of the fitted model; None: that in which the model holds, or the whole axis if it is not known.
    """

    measured: Frf
    band: tuple[float, float]
    fitted: ModalModel | None = None
    reference: ModalModel | None = None
    fit_band: tuple[float, float] | None = None

    @property
    def model_band(self) -> tuple[float, float]:
        """Part of the frequency axis in which the fitted model is drawn, Hz."""
        return self._shown(self.fit_band or (None if self.fitted is None else self.fitted.band))

    @property
    def reference_band(self) -> tuple[float, float]:
        """Part of the frequency axis in which the reference holds, Hz."""
        return self._shown(None if self.reference is None else self.reference.band)

    def _shown(self, band: tuple[float, float] | None) -> tuple[float, float]:
        low, high = band or self.band
        return max(low, self.band[0]), min(high, self.band[1])


def frf_figures(curves: FrfCurves) -> tuple[Figure, ...]:
    """Draw one page for every three responses by three excitations; columns are responses, rows are excitations.

    Raises
    ------
    InputError
        No line lies in the band.
    """
    frf = curves.measured
    if not ((frf.frequencies >= curves.band[0]) & (frf.frequencies <= curves.band[1])).any():
        raise InputError(
            f"no line of the FRF lies between {curves.band[0]:g} and {curves.band[1]:g} Hz; "
            f"it has {frf.frequencies[0]:g} to {frf.frequencies[-1]:g} Hz"
        )
    pages = []
    with house_style():
        for q in range(0, len(frf.excitations), PER_PAGE):
            for p in range(0, len(frf.responses), PER_PAGE):
                rows = range(q, min(q + PER_PAGE, len(frf.excitations)))
                pages.append(_page(curves, range(p, min(p + PER_PAGE, len(frf.responses))), rows))
    return tuple(pages)


def _page(curves: FrfCurves, responses: range, excitations: range) -> Figure:
    measured = curves.measured
    with_coherence = measured.multiple_coherence is not None or measured.coherence is not None
    page = _Page(len(responses), len(excitations), with_coherence)
    limits = _magnitude_limits(curves)
    for column, p in enumerate(responses):
        for row, q in enumerate(excitations):
            magnitude, phase = page.panel(row, column, MAGNITUDE), page.panel(row, column, PHASE)
            _draw_entry(magnitude, phase, curves, p, q)
            magnitude.set_ylim(*limits)
            _label(magnitude, phase, curves.measured, p, q, outer=column == 0)
        bottom = phase
        if with_coherence:
            bottom = page.panel(len(excitations), column, COHERENCE)
            _draw_coherence(bottom, curves, p, excitations, outer=column == 0)
        bottom.tick_params(labelbottom=True)
        bottom.set_xlabel("Frequency (Hz)")
    page.first.set_xlim(*curves.band)
    handles, labels = page.first.get_legend_handles_labels()
    page.figure.legend(handles, labels, loc="upper center", ncols=len(labels), borderaxespad=0.1)
    return page.figure


# top edge and height of a panel within its entry, mm
MAGNITUDE, PHASE, COHERENCE = (0.0, 34.0), (36.5, 17.0), (0.0, 20.0)


class _Page:
    """Page of panels at positions in millimetres, with the phase directly below its magnitude."""

    left, right, gap, top, entry, foot = 16.0, 4.5, 3.5, 11.0, 60.0, 10.0

    def __init__(self, n_columns: int, n_rows: int, with_coherence: bool) -> None:
        coherence = COHERENCE[1] if with_coherence else -4.0
        self.height = self.top + self.entry * n_rows + coherence + self.foot
        self.figure = new_figure(self.height, None)
        self.width = (WIDTH_MM - self.left - self.right - self.gap * (n_columns - 1)) / n_columns
        self._first: Axes | None = None

    @property
    def first(self) -> Axes:
        """The panel whose frequency axis all other panels share."""
        assert self._first is not None
        return self._first

    def panel(self, row: int, column: int, position: tuple[float, float]) -> Axes:
        """Add a panel of an entry."""
        x = self.left + column * (self.width + self.gap)
        bottom = self.height - self.top - row * self.entry - position[0] - position[1]
        corner = (x / WIDTH_MM, bottom / self.height, self.width / WIDTH_MM, position[1] / self.height)
        axes = self.figure.add_axes(corner, sharex=self._first)
        self._first = self._first or axes
        return axes


def coherent_lines(frf: Frf) -> NDArray[np.bool_]:
    """Return the valid lines with a coherence above 0.8 in any response; all valid lines where it is not known."""
    coherence = frf.multiple_coherence
    if coherence is None and frf.coherence is not None:
        coherence = frf.coherence.max(axis=2)
    if coherence is None:
        return frf.valid
    coherent = frf.valid & (np.nan_to_num(coherence).max(axis=1) > 0.8)
    return np.asarray(coherent) if coherent.any() else frf.valid


def lines_in_band(curves: FrfCurves) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64] | None]:
    """Return frequencies, values and standard deviation in the band; NaN where nothing was measured."""
    frf = curves.measured
    in_band = (frf.frequencies >= curves.band[0]) & (frf.frequencies <= curves.band[1])
    values = np.where(frf.valid[:, None, None], frf.values, np.nan)[in_band]
    if frf.measured is not None:
        values[:, ~frf.measured] = np.nan
    deviation = None
    known = frf.total_variance()
    if known is not None:
        variance = np.where(frf.valid[:, None, None] & np.isfinite(known), known, np.nan)
        deviation = np.sqrt(np.maximum(variance[in_band], 0.0))
    return frf.frequencies[in_band], values, deviation


def model_axis(model: ModalModel, model_band: tuple[float, float]) -> NDArray[np.float64]:
    """Return frequencies (Hz) that resolve every peak: evenly over the band, and dense around each mode."""
    low, high = max(model_band[0], 1e-3), model_band[1]
    width = np.abs(model.poles.real) / (2 * np.pi)
    near = model.natural_frequencies[:, None] + width[:, None] * _AROUND
    lines = np.concatenate([np.linspace(low, high, 600), near.ravel()])
    return np.unique(lines[(lines >= low) & (lines <= high)])


def _models(curves: FrfCurves) -> list[tuple[str, ModalModel, tuple[float, float], dict[str, Any]]]:
    models: list[tuple[str, ModalModel, tuple[float, float], dict[str, Any]]] = []
    if curves.reference is not None:
        dotted = {"color": TRUE, "linestyle": (0, (1, 1.2)), "linewidth": 1.6}
        models.append(("Reference model", curves.reference, curves.reference_band, dotted))
    if curves.fitted is not None:
        models.append(("Fitted model", curves.fitted, curves.model_band, {"color": FITTED, "linestyle": (0, (5, 1.5))}))
    return models


def _draw_entry(magnitude: Axes, phase: Axes, curves: FrfCurves, p: int, q: int) -> None:
    frequencies, values, deviation = lines_in_band(curves)
    size, angle = np.abs(values[:, p, q]), np.angle(values[:, p, q], deg=True)
    magnitude.set_yscale("log")  # before the lines: those of an entry that was not measured hold no number
    if deviation is not None:
        low, high = two_deviations(size, deviation[:, p, q])
        label = "± 2 standard deviations"
        magnitude.fill_between(frequencies, low, high, color="#bdbdbd", linewidth=0, label=label)
    magnitude.plot(frequencies, size, color=MEASURED, linewidth=0.9, label="Measured")
    # more than 2000 dots are drawn as pixels: as outlines they would make a page of tens of megabytes
    phase.plot(frequencies, angle, ".", color=MEASURED, markersize=1.8, rasterized=len(frequencies) > 2000)
    for label, model, band, style in _models(curves):
        axis = model_axis(model, band)
        entry = model_entry(model, axis, curves.measured, p, q)
        if entry is None:
            continue
        magnitude.plot(axis, np.abs(entry), label=label, **style)
        phase.plot(axis, phase_line(entry), **style)
    if np.isnan(size).all():
        magnitude.text(0.5, 0.5, "not measured", transform=magnitude.transAxes, ha="center", va="center")


def model_entry(
    model: ModalModel, axis: NDArray[np.float64], like: Frf, p: int, q: int
) -> NDArray[np.complex128] | None:
    """Return the model's entry with the same degrees of freedom and exponential window; None if there is none."""
    if like.responses[p] not in model.responses or like.excitations[q] not in model.excitations:
        return None
    row, column = model.responses.index(like.responses[p]), model.excitations.index(like.excitations[q])
    if model.measured is not None and not model.measured[row, column]:
        return None
    tau = like.exponential_time_constant
    s = np.asarray(2j * np.pi * axis + (0.0 if tau is None else 1 / tau), dtype=np.complex128)
    return np.asarray(model.at(s)[:, row, column])


def two_deviations(size: NDArray[np.float64], deviation: NDArray[np.float64]) -> tuple[Any, Any]:
    """Return a magnitude minus and plus two standard deviations; both are positive because the axis is logarithmic."""
    return np.maximum(size - 2 * deviation, 1e-3 * size), size + 2 * deviation


def phase_line(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the phase in degrees, NaN after each jump from +180 to -180 degrees, so that the line is interrupted."""
    angle = np.angle(values, deg=True)
    angle[1:][np.abs(np.diff(angle)) > 180] = np.nan
    return np.asarray(angle)


def _magnitude_limits(curves: FrfCurves) -> tuple[float, float]:
    """Return one magnitude scale of at most six decades for all entries, so that entries can be compared.

    If there is a fit, only the lines of its band count: below the band, a receptance from accelerations is noise
    divided by the square of the angular frequency.
    """
    frf = curves.measured
    low, high = curves.model_band
    in_band = (frf.frequencies >= low) & (frf.frequencies <= high)
    size = np.abs(frf.values[in_band & coherent_lines(frf)])
    size = size[np.isfinite(size) & (size > 0)]
    if not len(size):
        return 1e-9, 1e-3
    top = float(size.max()) * 2.5
    return max(float(np.percentile(size, 1)) / 2.5, top * 1e-6), top


def _label(magnitude: Axes, phase: Axes, frf: Frf, p: int, q: int, *, outer: bool) -> None:
    magnitude.set_title(f"{frf.responses[p]} / {frf.excitations[q]}", pad=3)
    magnitude.tick_params(labelbottom=False, labelleft=outer)
    phase.tick_params(labelbottom=False, labelleft=outer)
    phase.set_ylim(-230, 230)  # room for the labels at 180
    phase.yaxis.set_major_locator(MultipleLocator(90))
    phase.set_yticks([-180, 0, 180])
    if outer:
        symbol = SYMBOLS.get(frf.quantity, "H")
        magnitude.set_ylabel(f"|{symbol}| ({frf.unit})")
        phase.set_ylabel("Phase (°)")
        for axes in (magnitude, phase):
            axes.yaxis.set_label_coords(-11.5 / (axes.bbox.width / axes.figure.dpi * 25.4), 0.5)


def _draw_coherence(axes: Axes, curves: FrfCurves, p: int, excitations: range, *, outer: bool) -> None:
    """Draw the multiple coherence of a response, or its ordinary coherences with the excitations of this page."""
    frf = curves.measured
    if frf.multiple_coherence is not None:
        axes.plot(frf.frequencies, frf.multiple_coherence[:, p], color=MEASURED, linewidth=0.9)
    elif frf.coherence is not None:
        for q, dashes in zip(excitations, ("-", "--", ":"), strict=False):
            axes.plot(frf.frequencies, frf.coherence[:, p, q], dashes, color=MEASURED, linewidth=0.9)
    axes.set_ylim(0, 1.05)
    axes.set_yticks([0, 0.5, 1])
    kind = "Coherence" if frf.multiple_coherence is None else "Multiple coherence"
    axes.set_title(f"{kind} of {frf.responses[p]}", pad=3)
    axes.tick_params(labelleft=outer)
    if outer:
        axes.set_ylabel("γ² (1)")
        axes.yaxis.set_label_coords(-11.5 / (axes.bbox.width / axes.figure.dpi * 25.4), 0.5)


MAX_ENTRIES = 9  # entries that are drawn where none is named

# what can be drawn of an FRF, and the label of its axis
PARTS: Mapping[str, tuple[Callable[[NDArray[np.complex128]], NDArray[np.float64]], str]] = {
    "magnitude": (np.abs, "Magnitude of {quantity} ({unit})"),
    "phase": (lambda values: np.angle(values, deg=True), "Phase of {quantity} (deg)"),
    "real": (np.real, "Real part of {quantity} ({unit})"),
    "imaginary": (np.imag, "Imaginary part of {quantity} ({unit})"),
}


def draw_frf(
    frf: Frf,
    axes: Axes | None = None,
    *,
    response: str | None = None,
    excitation: str | None = None,
    part: str = "magnitude",
    quantity: str | None = None,
    **line: Any,
) -> Axes:
    """Draw entries of an FRF over frequency, with gaps at lines that are not valid.

    Lines outside the band in which the FRF holds are pale and dotted, and the legend of given axes says so.

    Parameters
    ----------
    frf
        FRF matrix of any quantity.
    axes
        Axes to draw into; None: new ones.
    response, excitation
        Degrees of freedom to draw; None: all that were measured, of more than nine entries the first nine.
    part
        ``magnitude`` (logarithmic), ``phase``, ``real`` or ``imaginary``.
    quantity
        ``receptance``, ``mobility`` or ``accelerance`` to draw; None: the quantity in the label of the axes, else the
        FRF's own.
    line
        Settings of matplotlib's lines, such as ``color`` or ``label``.

    Raises
    ------
    InputError
        A degree of freedom, a part or a quantity that does not exist.
    """
    frf = in_quantity(frf, quantity or _quantity_in(axes))
    if part not in PARTS:
        raise InputError(f"unknown part {part!r} of an FRF; use one of {', '.join(PARTS)}")
    entries = chosen_entries(frf, response, excitation)
    if frf.measured is not None and response is None and excitation is None:
        entries = [entry for entry in entries if frf.measured[entry]]  # the others are 0
    part_of, name = PARTS[part]
    within = _in_band(frf)
    with given_or_new(axes) as panel:
        for number, (p, q) in enumerate(entries[:MAX_ENTRIES]):
            values = np.where(frf.valid, part_of(frf.values[:, p, q]), np.nan)
            label = line.get("label", f"{frf.responses[p]} / {frf.excitations[q]}")
            if "label" in line and number:
                label = "_nolegend_"  # a common name of all entries appears in the legend once
            holds = np.where(within, values, np.nan)
            [drawn] = panel.plot(frf.frequencies, holds, **{**line_style(number), **line, "label": label})
            if np.isfinite(values[~within]).any():
                named = axes is not None and not number  # new axes begin and end with the band
                beyond = np.where(_with_ends(~within), values, np.nan)
                panel.plot(frf.frequencies, beyond, **_outside(frf, drawn, named))
        if part == "magnitude":
            panel.set_yscale("log")
        panel.set_xlabel("Frequency (Hz)")
        panel.set_ylabel(name.format(quantity=frf.quantity, unit=frf.unit.replace("^2", "²")))
        if axes is None:
            panel.set_xlim(*_band(frf))
        few = None if len(entries) <= MAX_ENTRIES else f"{MAX_ENTRIES} of {len(entries)} entries"
        legend_beside(panel, few)
    return panel


def _quantity_in(axes: Axes | None) -> str | None:
    """Return the FRF quantity in the label of the magnitude axis; None if the axes are empty or name no quantity."""
    if axes is None or not axes.has_data():
        return None
    return next((name for name in FRF_ORDERS if re.search(rf"\b{name}\b", axes.get_ylabel())), None)


def in_quantity(frf: Frf, quantity: str | None) -> Frf:
    """Convert an FRF of motion over force to receptance, mobility or accelerance: ``s^n`` times the receptance.

    The FRF is returned unchanged if ``quantity`` is None or if it is a ``transfer``, which cannot be converted.
    """
    if quantity is None or quantity == frf.quantity or frf.quantity not in FRF_ORDERS:
        return frf
    if quantity not in FRF_ORDERS:
        raise InputError(f"unknown quantity {quantity!r} of an FRF; use one of {', '.join(FRF_ORDERS)}")
    receptance, order = to_receptance(frf), FRF_ORDERS[quantity]
    unit = receptance.unit.replace("m/", f"m/{('', 's/', 's^2/')[order]}", 1)
    factor = (receptance.laplace**order)[:, None, None]
    return replace(receptance, values=receptance.values * factor, quantity=quantity, unit=unit, covariance=None)


def chosen_entries(frf: Frf, response: str | None, excitation: str | None) -> list[tuple[int, int]]:
    """Return the row and column of each entry that is to be drawn."""
    rows = chosen_indices("response", frf.responses, response)
    columns = chosen_indices("excitation", frf.excitations, excitation)
    return [(p, q) for p in rows for q in columns]


def _in_band(frf: Frf) -> NDArray[np.bool_]:
    """Return which lines lie in the band in which the FRF holds; all if it is not known."""
    low, high = frf.band or (0.0, np.inf)
    return np.asarray((frf.frequencies >= low) & (frf.frequencies <= high))


def _with_ends(lines: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Add to some lines their neighbours, so that curves of both parts meet."""
    near = lines.copy()
    near[1:] |= lines[:-1]
    near[:-1] |= lines[1:]
    return near


def _outside(frf: Frf, drawn: Line2D, named: bool) -> dict[str, Any]:
    """Return the style of a curve outside the band of the FRF; ``drawn`` is its part in the band."""
    low, high = frf.band or (0.0, np.inf)
    return {
        "color": drawn.get_color(),
        "alpha": 0.45,
        "linestyle": (0, (1, 1.5)),
        "linewidth": 0.8 * drawn.get_linewidth(),
        "label": f"outside the band, {low:.4g} to {high:.4g} Hz" if named else "_nolegend_",
        "gid": "outside the band",
    }


def _band(frf: Frf) -> tuple[float, float]:
    """Return the band of the FRF, else the band of its valid lines, Hz."""
    if frf.band is not None:
        return frf.band
    lines = frf.frequencies[frf.valid] if frf.valid.any() else frf.frequencies
    return float(lines[0]), float(lines[-1])
