"""The page itself: buttons above, figures below, fed a few times a second."""

import html
import time
from typing import Any

from .control import LiveControl
from .drawing import Drawing
from .frequency_drawings import enough, spectrum, transfer
from .monitor import LiveMonitor, Snapshot
from .time_drawings import levels, traces

PERIOD_MS = 500
_SPECTRA_SHOWN = 4


def build_page(document: Any, monitor: LiveMonitor, control: LiveControl) -> None:
    """Fill a Bokeh document; called once for every browser that connects."""
    from bokeh.layouts import column, row
    from bokeh.models import Button, Div, MultiChoice, Select, TextInput

    responses, excitations, names = _choices(monitor)
    start = Button(label="Start", button_type="success", name="start")
    note = TextInput(placeholder="note for the next mark", name="note", width=220)
    mark = Button(label="Mark", name="mark")
    stop = Button(label="Stop", button_type="danger", name="stop")
    start.on_click(control.start)

    def set_mark() -> None:
        control.mark(note.value, monitor.seconds)
        note.value = ""

    mark.on_click(set_mark)
    stop.on_click(control.stop)
    status = Div(text="connected", name="status", sizing_mode="stretch_width")
    shown = MultiChoice(title="Spectra of", options=names, value=names[:_SPECTRA_SHOWN], width=420)
    response = Select(title="Response", options=responses or ["none"], value=(responses or ["none"])[0])
    excitation = Select(title="Excitation", options=excitations or ["none"], value=(excitations or ["none"])[0])

    def entry() -> tuple[int, int]:
        return response.options.index(response.value), excitation.options.index(excitation.value)

    drawings = [
        *(traces(monitor.channels, lambda: control.marks), levels(monitor.channels)),
        *(spectrum(monitor.channels, lambda: list(shown.value)), transfer("magnitude", entry)),
        *(transfer("coherence", entry), transfer("phase", entry), enough()),
    ]
    figures = [drawing.figure for drawing in drawings]
    for figure in figures:
        figure.sizing_mode = "stretch_width"
    document.title = "millfrf live"
    document.add_root(
        column(
            row(start, note, mark, stop, status, sizing_mode="stretch_width"),
            row(figures[0], figures[1], sizing_mode="stretch_width"),
            row(shown, response, excitation),
            row(figures[2], figures[3], sizing_mode="stretch_width"),
            row(figures[4], figures[5], figures[6], sizing_mode="stretch_width"),
            sizing_mode="stretch_width",
        )
    )
    document.add_periodic_callback(_feeder(drawings, status, (start, mark, stop), monitor, control), PERIOD_MS)


def _choices(monitor: LiveMonitor) -> tuple[list[str], list[str], list[str]]:
    """Response, excitation and all names, in the order of the spectra."""
    from estimation import EXCITING, RESPONDING

    excitations = [c.name for c in monitor.channels if c.quantity in EXCITING and c.node]
    responses = [c.name for c in monitor.channels if c.quantity in RESPONDING]
    return responses, excitations, [*excitations, *responses]


def _feeder(
    drawings: list[Drawing], status: Any, buttons: tuple[Any, Any, Any], monitor: LiveMonitor, control: LiveControl
) -> Any:
    """Make the function that feeds one page; it leaves a beat out where drawing takes over half a period."""
    rest_until = 0.0

    def feed() -> None:
        nonlocal rest_until
        began = time.monotonic()
        if began < rest_until:
            return
        now = monitor.snapshot()
        for drawing in drawings:
            drawing.update(now)
        status.text = status_line(now, control)
        start, mark, stop = buttons
        start.disabled = control.state != "waiting"
        mark.disabled = control.state != "recording"
        stop.disabled = control.state not in ("waiting", "recording")
        rest_until = began + 3 * (time.monotonic() - began)

    return feed


def status_line(now: Snapshot, control: LiveControl) -> str:
    """State, time, samples, marks, and what was left out of the drawing; as HTML."""
    n = len(control.marks)
    marks = f", {n} mark{'' if n == 1 else 's'}" + (f" (last: {html.escape(control.marks[-1].label)})" if n else "")
    skipped = f", {now.n_skipped} blocks recorded but not drawn" if now.n_skipped else ""
    averages = "" if now.spectra is None else f", {now.spectra.averages:.0f} averages"
    message = f" {html.escape(control.message)}" if control.message else ""
    return (
        f"<b>{control.state}</b> {now.seconds:.1f} s, {now.n_samples} samples a channel{averages}, "
        f"{marks.removeprefix(', ')}{skipped}.{message}"
    )
