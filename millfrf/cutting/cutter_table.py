"""Table ``[cutter]`` of a cutting file: the shape of the cutter's edges."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Strict, ValidationError

from millfrf.core import FileFormatError, InputError, mistake_in_words

from .process import MillingProcess
from .profile import ProfileElement, ball_profile, bull_nose_profile, straight_profile

Number = Annotated[float, Strict()]
CutterShape = Literal["square", "ball", "bull-nose", "tapered", "elements"]


class ElementTable(BaseModel):
    """A straight line or an arc of the cutter's profile, from the tip upwards.

    Parameters
    ----------
    radius_m : m
        Radius of the cutter at the lower end of the element.
    edge_angle_deg : deg
        Angle between the edge and the plane of rotation at the lower end, 0 to below 180; 90: parallel to the axis.
    length_m : m
        Length along the edge; without it the element has no upper end.
    end_edge_angle_deg : deg
        Edge angle at the upper end, for an arc; without it the element is straight.
    """

    model_config = ConfigDict(extra="forbid", strict=False, allow_inf_nan=False)

    radius_m: Number
    edge_angle_deg: Number = 90.0
    length_m: Number | None = None
    end_edge_angle_deg: Number | None = None


class CutterTable(BaseModel):
    """The table ``[cutter]``: the shape of the edges, where they are not those of a square end mill.

    Force coefficients count per width of the edge if the shape is not ``square``.

    Parameters
    ----------
    shape
        ``square``, ``ball``, ``bull-nose`` (with ``corner_radius_m``), ``tapered`` (with ``taper_angle_deg``; also
        inserts with a lead angle) or ``elements``.
    corner_radius_m : m
        Corner radius of a bull-nose end mill, above 0 and at most half the diameter.
    taper_angle_deg : deg
        Angle between the edges and the axis, above 0 and below 90; ``diameter_m`` is then that of the tip. A face mill
        with a lead angle of 45 deg has a taper of 45 deg.
    helix_angles_deg : deg
        Helix angle of each tooth, where they differ.
    serration_amplitude_m : m
        Amplitude of the radial wave of serrated edges, 0 or more.
    serration_wavelength_m : m
        Axial length of that wave; from tooth to tooth it is shifted by a tooth's share of a wave.
    elements
        Elements of the profile from the tip upwards, for the shape ``elements``.
    """

    model_config = ConfigDict(extra="forbid", strict=False, allow_inf_nan=False)

    shape: CutterShape = "square"
    corner_radius_m: Number | None = None
    taper_angle_deg: Number | None = None
    helix_angles_deg: tuple[Number, ...] = ()
    serration_amplitude_m: Number = 0.0
    serration_wavelength_m: Number = 0.0
    elements: tuple[ElementTable, ...] = ()


def cutter_fields(table: Mapping[str, Any], diameter: float, name: str) -> dict[str, Any]:
    """Return the fields of `MillingProcess` that a table ``[cutter]`` states.

    Parameters
    ----------
    table
        Keys and values.
    diameter : m
        Diameter of the cutter.
    name
        Name of the file, for messages.

    Raises
    ------
    InputError
        A value that does not fit the shape.
    FileFormatError
        A key unknown, missing or of the wrong type.
    """
    try:
        cutter = CutterTable.model_validate(table)
    except ValidationError as error:
        raise FileFormatError(f"{name}: cutter.{mistake_in_words(error, CutterTable)}") from error
    _check_keys(cutter, name)
    try:
        return {
            "profile": _profile(cutter, diameter),
            "helix_angles": tuple(math.radians(angle) for angle in cutter.helix_angles_deg),
            "serration_amplitude": cutter.serration_amplitude_m,
            "serration_wavelength": cutter.serration_wavelength_m,
        }
    except InputError as error:
        raise InputError(f"{name}: cutter: {error}") from error


_NEEDED = {"bull-nose": "corner_radius_m", "tapered": "taper_angle_deg", "elements": "elements"}


def _check_keys(cutter: CutterTable, name: str) -> None:
    """Refuse a shape without the key that it needs, and a key that another shape needs."""
    for shape, key in _NEEDED.items():
        given = getattr(cutter, key) not in (None, ())
        if given != (shape == cutter.shape):
            reason = f"goes with shape = {shape!r} only" if given else f"is missing for shape = {shape!r}"
            raise FileFormatError(f"{name}: cutter.{key} {reason}; correct shape or {key}")


def _profile(cutter: CutterTable, diameter: float) -> tuple[ProfileElement, ...]:
    if cutter.shape == "ball":
        return ball_profile(diameter)
    if cutter.corner_radius_m is not None:
        return bull_nose_profile(diameter, cutter.corner_radius_m)
    if cutter.taper_angle_deg is not None:
        if not 0 < cutter.taper_angle_deg < 90:
            raise InputError(f"taper_angle_deg = {cutter.taper_angle_deg:g} is outside 0 to 90")
        return straight_profile(diameter, math.radians(90.0 - cutter.taper_angle_deg))
    return tuple(_element(row) for row in cutter.elements)


def _element(row: ElementTable) -> ProfileElement:
    angle = math.radians(row.edge_angle_deg)
    if row.end_edge_angle_deg is None:
        return ProfileElement(row.radius_m, angle, math.inf if row.length_m is None else row.length_m)
    if not (row.length_m or 0) > 0:
        raise InputError("an element with end_edge_angle_deg is an arc; give its length_m, above 0")
    length = float(row.length_m or 0)
    return ProfileElement(row.radius_m, angle, length, (math.radians(row.end_edge_angle_deg) - angle) / length)


def cutter_rows(process: MillingProcess) -> list[str]:
    """Return the lines of the tables that state the shape of a process's cutter; none for a square end mill."""
    rows = []
    if process.profile:
        rows.append('shape = "elements"')
    if process.helix_angles:
        rows.append(f"helix_angles_deg = [{', '.join(_degrees(angle) for angle in process.helix_angles)}]")
    if process.serration_amplitude:
        rows.append(f"serration_amplitude_m = {process.serration_amplitude!r}")
        rows.append(f"serration_wavelength_m = {process.serration_wavelength!r}")
    if not rows:
        return []
    lines = ["", "[cutter]", *rows]
    for element in process.profile:
        lines += ["", "[[cutter.elements]]", f"radius_m = {element.radius!r}"]
        lines.append(f"edge_angle_deg = {_degrees(element.edge_angle)}")
        if math.isfinite(element.length):
            lines.append(f"length_m = {element.length!r}")
        if element.curvature:
            lines.append(f"end_edge_angle_deg = {_degrees(element.angle_at(element.length))}")
    return lines


def _degrees(angle: float) -> str:
    return repr(round(math.degrees(angle), 9))
