"""Sliders of a cut, and the cutting file that they state."""

from pathlib import Path
from typing import Any

import panel_material_ui as pmui
import tomlkit

from millfrf.core import InputError
from millfrf.cutting import MillingProcess, milling_process

from .own_files import write_own

ANGLES = "angles"
ENGAGEMENTS = {"Down milling": "down", "Up milling": "up", "Slot": "slot", "Central": "central", "By angles": ANGLES}

_SLIDERS: dict[str, tuple[str, float, float, float, float, float]] = {
    # key of the cutting file: label, factor to its unit, lowest, highest, step, value at the beginning
    "teeth": ("Teeth", 1, 1, 12, 1, 2),
    "diameter_m": ("Diameter (mm)", 1e-3, 1, 100, 0.5, 12),
    "helix_angle_deg": ("Helix angle (degrees)", 1, 0, 60, 1, 0),
    "radial_depth_m": ("Width of cut (mm)", 1e-3, 0.1, 100, 0.1, 6),
    "start_angle_deg": ("Teeth enter at (degrees)", 1, 0, 180, 1, 90),
    "exit_angle_deg": ("Teeth leave at (degrees)", 1, 0, 180, 1, 180),
    "ktc_pa": ("Tangential coefficient ktc (MPa)", 1e6, 20, 5000, 10, 700),
    "krc": ("Radial coefficient krc (of ktc)", 1, 0, 1, 0.01, 0.3),
    "kac": ("Axial coefficient kac (of ktc)", 1, 0, 1, 0.01, 0),
    "feed_per_tooth_m": ("Feed per tooth (mm)", 1e-3, 0.005, 1, 0.005, 0.1),
}
_OF_ANGLES = ("start_angle_deg", "exit_angle_deg")


class CutFields:
    """Sliders for cutter, engagement and coefficients; the other keys of a cutting file stay as they are."""

    def __init__(self) -> None:
        self._table: dict[str, Any] = {}
        self._cutter: dict[str, Any] = {}
        self.engagement = pmui.RadioButtonGroup(label="Engagement", options=ENGAGEMENTS, value="down")
        self.sliders = {key: _slider(key) for key in _SLIDERS}
        self.engagement.param.watch(self._show, "value")
        self._show()

    def _show(self, _: Any = None) -> None:
        """Show the sliders that the engagement needs."""
        for key in _OF_ANGLES:
            self.sliders[key].visible = self.engagement.value == ANGLES
        self.sliders["radial_depth_m"].visible = self.engagement.value not in (ANGLES, "slot")

    @property
    def fields(self) -> tuple[Any, ...]:
        """Fields in their order: cutter, engagement, coefficients."""
        listed = list(self.sliders.values())
        return (*listed[:3], self.engagement, *listed[3:])

    def reset(self) -> None:
        """Begin anew: forget the cutting file that was read."""
        self._table, self._cutter, self.engagement.value = {}, {}, "down"
        for key, (_, _, low, high, _, value) in _SLIDERS.items():
            self.sliders[key].param.update(start=low, end=high, value=value)

    def read(self, path: Path) -> None:
        """Begin with the numbers of a cutting file.

        Raises
        ------
        InputError
            The file describes turning, which has no sliders.
        """
        content = tomlkit.parse(path.read_text(encoding="utf-8")).unwrap()
        if "cutting" not in content:
            raise InputError(f"{path.name} describes no milling; change it in an editor")
        self.reset()
        self._table, self._cutter = dict(content["cutting"]), dict(content.get("cutter", {}))
        self.engagement.value = self._table.get("immersion", ANGLES)
        for key, (_, factor, low, high, _, _) in _SLIDERS.items():
            if isinstance(value := self._table.get(key), int | float):
                shown = value if key == "teeth" else _rounded(value / factor)
                slider = self.sliders[key]
                slider.param.update(start=min(low, shown), end=max(high, shown), value=shown)

    @property
    def table(self) -> dict[str, Any]:
        """Keys of ``[cutting]`` as the fields state them."""
        stated = {key: _rounded(slider.value * _SLIDERS[key][1]) for key, slider in self.sliders.items()}
        stated["teeth"] = int(stated["teeth"])
        left_out = set(_OF_ANGLES) if self.engagement.value != ANGLES else {"immersion", "radial_depth_m"}
        left_out |= {"radial_depth_m"} if self.engagement.value == "slot" else set()
        left_out |= set() if stated["helix_angle_deg"] else {"helix_angle_deg"}
        table = self._table | stated | {"immersion": self.engagement.value}
        return {key: value for key, value in table.items() if key not in left_out}

    @property
    def process(self) -> MillingProcess:
        """The cut as the fields state it.

        Raises
        ------
        InputError
            Numbers that contradict each other.
        """
        return milling_process(cutter=self._cutter or None, **self.table)

    def write(self, path: Path) -> None:
        """Write the cutting file.

        Raises
        ------
        InputError
            Numbers that contradict each other, or a file of the user has this name.
        """
        _ = self.process  # refused before anything is written
        document = tomlkit.document()
        document["cutting"] = self.table
        if self._cutter:
            document["cutter"] = self._cutter
        write_own(path, tomlkit.dumps(document), "a cut as its sliders stated it")


def _slider(key: str) -> Any:
    label, _, low, high, step, value = _SLIDERS[key]
    kind = pmui.IntSlider if key == "teeth" else pmui.FloatSlider
    return kind(label=label, start=low, end=high, step=step, value=value, width=420, show_value=True)


def _rounded(value: float) -> float:
    """Remove the digits that a factor of units adds."""
    return float(f"{value:.10g}")
