"""The page on which poles are picked: stabilisation chart, list of poles, and the FRF with the fit of the choice."""

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

import panel as pn
import panel_material_ui as pmui
from bokeh.events import Tap

from millfrf.core import MillfrfError
from millfrf.figures import curve_columns, frf_panels, picking_chart

from .panel_server import said, set_columns
from .picking import (
    PickSession,
    Pole,
    are_alike,
    checked_pole,
    chosen_at_first,
    entry_curves,
    entry_label,
    fit_choice,
    grid_of,
    lines_of,
    nearest_pole,
)


class PickingPage:
    """Poles to pick, and the fit of those that are chosen.

    Parameters
    ----------
    session
        FRF with its automatic fit.
    ended
        Called with the chosen poles when they are saved, with None when the page is left without saving.
    """

    def __init__(self, session: PickSession, ended: Callable[[list[Pole] | None], None]) -> None:
        self._session, self._ended = session, ended
        self._offered: dict[str, Pole] = {}
        for group in sorted(session.groups, key=lambda group: (not group.taken, -group.n_orders)):
            words = f"{group.n_orders} orders, {'taken' if group.taken else group.reason}"
            pole = group.frequency, group.damping_ratio
            self._offered[f"{_named(pole)}: {words}"] = pole
        self._asked = 0
        self._chart = picking_chart(session.automatic.chart, session.frf)
        self._source = self._chart.select_one({"name": "chosen"})
        p, q = session.entries[0]
        curves = entry_curves(session, session.automatic.model, p, q)
        self._frf = frf_panels(curves, lines_of(session), grid_of(session), f"|H| ({session.frf.unit})")
        labels = {entry_label(session, k): k for k in range(len(session.entries))}
        self.entry = pn.widgets.Select(label="Response / excitation", options=labels, value=0, width=420)
        self.chosen = pmui.CheckBoxGroup(label="Poles", options=list(self._offered), value=self._at_first())
        self.frequency = pmui.TextInput(label="Frequency (Hz)", width=200)
        self.damping = pmui.TextInput(label="Damping ratio (%)", value="2", width=200)
        self._said = pn.pane.HTML("", sizing_mode="stretch_width")
        self._watch()

    def _watch(self) -> None:
        for field in (self.chosen, self.entry):
            field.param.watch(self._changed, "value")
        for name in ("orders", "damping"):
            panel = self._chart.select_one({"name": name})
            panel.on_event(Tap, lambda event, name=name, panel=panel: self._tapped(event, name, panel))
        self._mark()

    @property
    def view(self) -> Any:
        """Buttons, chart, FRF and list as a column."""
        save = pmui.Button(label="Save the poles", color="primary", variant="contained", on_click=self._save)
        again = pmui.Button(label="Start again", variant="outlined", on_click=self._start_again)
        leave = pmui.Button(label="Leave without saving", variant="outlined", on_click=lambda _: self._end(None))
        add = pmui.Button(label="Add this pole", variant="outlined", on_click=self._add)
        hint = "Click a pole of the chart to choose it, or a chosen one to drop it; the list does the same by keyboard."
        return pmui.Column(
            pmui.Typography(hint, variant="body2"),
            pmui.Row(save, again, leave),
            self._said,
            pn.pane.Bokeh(self._chart, sizing_mode="stretch_width"),
            self.entry,
            pn.pane.Bokeh(self._frf, sizing_mode="stretch_width"),
            pmui.Column(self.chosen, scroll=True, height=280, sizing_mode="stretch_width"),
            pmui.Row(self.frequency, self.damping, add),
            sizing_mode="stretch_width",
        )

    @property
    def poles(self) -> list[Pole]:
        """Chosen poles, by frequency."""
        return sorted(self._offered[name] for name in self.chosen.value)

    def _at_first(self) -> list[str]:
        chosen = chosen_at_first(self._session)
        return [name for name, pole in self._offered.items() if pole in chosen]

    def _mark(self) -> None:
        top = self._chart.select_one({"name": "top"}).end
        frequencies, dampings = [f for f, _ in self.poles], [100 * zeta for _, zeta in self.poles]
        ends = {"low": [0.0] * len(frequencies), "high": [top] * len(frequencies)}
        set_columns(self._source, {"f": frequencies, "zeta": dampings, **ends})

    async def _changed(self, _: Any) -> None:
        """Fit the choice; of several changes only the last one is drawn."""
        self._mark()
        self._asked += 1
        asked, entry = self._asked, int(self.entry.value)
        self._say(f"fitting {len(self.poles)} poles …")
        try:
            fit = await asyncio.to_thread(fit_choice, self._session, self.poles, entry)
        except MillfrfError as error:
            self._say(str(error), "alert")
            return
        if asked != self._asked:
            return
        for name, columns in curve_columns(fit.curves).items():
            source = self._frf.select_one({"name": name})
            set_columns(source, {**source.data, **{key: values.astype("f4") for key, values in columns.items()}})
        low, middle, high = fit.misfits
        self._say(
            f"{len(self.poles)} poles: misfit of this FRF {fit.misfit:.2g} %, of all FRFs {low:.2g} to {high:.2g} % "
            f"(median {middle:.2g} %).",
            more=fit.warnings,
        )

    def _tapped(self, event: Any, name: str, panel: Any) -> None:
        """Choose or drop the pole at a click."""
        wide = (panel.x_range.end - panel.x_range.start) / max(panel.inner_width or 800, 1)
        tall = (panel.y_range.end - panel.y_range.start) / max(panel.inner_height or 300, 1)
        pole = nearest_pole(self._session, (event.x, event.y), (wide, tall), name)
        if pole is None:
            self._say("No pole is near; click nearer to a mark.", "alert")
            return
        alike = [name for name in self.chosen.value if are_alike(self._offered[name], pole)]
        if alike:
            self.chosen.value = [name for name in self.chosen.value if name != alike[0]]
        else:
            self._choose(pole)

    def _add(self, _: Any) -> None:
        try:
            self._choose(checked_pole(self.frequency.value, self.damping.value))
        except MillfrfError as error:
            self._say(str(error), "alert")

    def _choose(self, pole: Pole) -> None:
        known = [name for name, offered in self._offered.items() if offered == pole]
        name = known[0] if known else f"{_named(pole)}: picked"
        self._offered[name] = pole
        value = list(dict.fromkeys([*self.chosen.value, name]))
        self.chosen.param.update(options=list(self._offered), value=value)

    def _start_again(self, _: Any) -> None:
        self.chosen.value = self._at_first()

    async def _save(self, _: Any) -> None:
        try:
            await asyncio.to_thread(fit_choice, self._session, self.poles, int(self.entry.value))
        except MillfrfError as error:
            self._say(str(error), "alert")
            return
        self._end(self.poles)

    def _end(self, poles: list[Pole] | None) -> None:
        self._say("Nothing was saved." if poles is None else "Saved.")
        self._ended(poles)

    def _say(self, text: str, role: str = "status", more: Sequence[str] = ()) -> None:
        self._said.object = said(text, role, more)


def _named(pole: Pole) -> str:
    return f"{pole[0]:.3f} Hz, {100 * pole[1]:.3f} %"
