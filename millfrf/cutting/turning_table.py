"""Table ``[turning]`` of a cutting file: a turning or boring cut."""

import math
from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from millfrf.core import FileFormatError, InputError, mistake_in_words

from .coefficient_keys import CoefficientKeys, Number, coefficient_entries, coefficient_fields
from .process import MillingProcess
from .turning import approach_angle_of, nose_radius_of, turning_process


class _TurningKeys(BaseModel):
    """Keys of a table ``[turning]`` that a table ``[cutting]`` has not, or with another meaning.

    Parameters
    ----------
    diameter_m : m
        Diameter of the workpiece at the cut, above 0; it enters the cutting speed and so the process damping.
    edge_angle_deg : deg
        Angle between edge and direction of feed (approach angle), above 0 to 90.
    nose_radius_m : m
        Nose radius of the insert, 0 or more.
    feed_per_revolution_m : m
        Feed per revolution, 0 or more; it changes the depth limit only with ``ktc_exponent``.
    ktc_pa : Pa
        Force coefficient along the cutting speed (specific cutting force), above 0, per width of the edge and chip
        thickness. Typical: 0.5e9 to 1e9 for aluminium, 2e9 to 3e9 for steel.
    krc
        Coefficient normal to the edge as a share of ``ktc_pa``; positive: the chip pushes the tool away.
    kac
        Coefficient along the edge as a share of ``ktc_pa``; positive: the chip pulls the tool into the workpiece.
    kte_n_per_m : N/m
        Edge coefficient along the cutting speed, 0 or more: force per metre of edge in addition to that of the chip.
    kre_n_per_m : N/m
        Edge coefficient normal to the edge, 0 or more.
    kae_n_per_m : N/m
        Edge coefficient along the edge, 0 or more.
    """

    diameter_m: Number
    edge_angle_deg: Number = 90.0
    nose_radius_m: Number = 0.0
    feed_per_revolution_m: Number = 0.0
    ktc_pa: Number
    krc: Number
    kac: Number = 0.0
    kte_n_per_m: Number = 0.0
    kre_n_per_m: Number = 0.0
    kae_n_per_m: Number = 0.0


class TurningTable(CoefficientKeys, _TurningKeys):
    """The table ``[turning]``, in place of ``[cutting]``: tool, workpiece and force coefficients.

    The structure's X is the direction of feed, Y that of the surface's motion at the tool, and Z points out of the
    workpiece, across feed and cutting speed.
    """


def turning_from_table(table: Mapping[str, Any], name: str) -> MillingProcess:
    """Return the process of a table ``[turning]``; ``name`` is that of the file, for messages.

    Raises
    ------
    InputError
        A value out of its range.
    FileFormatError
        A key unknown, missing or of the wrong type.
    """
    try:
        stated = TurningTable.model_validate(table)
    except ValidationError as error:
        raise FileFormatError(f"{name}: turning.{mistake_in_words(error, TurningTable)}") from error
    try:
        return turning_process(
            stated.diameter_m,
            math.radians(stated.edge_angle_deg),
            feed=stated.feed_per_revolution_m,
            nose_radius=stated.nose_radius_m,
            **coefficient_fields(stated),
        )
    except InputError as error:
        raise type(error)(f"{name}: {error}") from error


def turning_rows(process: MillingProcess) -> list[str]:
    """Return the lines of a table ``[turning]``."""
    entries = {
        "diameter_m": repr(float(process.diameter)),
        # rounded, as a conversion to radians and back does not return the same number
        "edge_angle_deg": repr(round(math.degrees(approach_angle_of(process)), 9)),
        "nose_radius_m": repr(nose_radius_of(process)),
        "feed_per_revolution_m": repr(float(process.feed_per_tooth)),
        **coefficient_entries(process),
    }
    return ["[turning]", *(f"{key} = {value}" for key, value in entries.items())]
