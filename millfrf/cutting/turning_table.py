"""Table ``[turning]`` of a cutting file: a turning or boring cut."""

import math
from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Strict, ValidationError

from millfrf.core import FileFormatError, InputError, mistake_in_words

from .coefficient_keys import coefficient_entries, coefficient_fields
from .process import MillingProcess
from .turning import approach_angle_of, nose_radius_of, turning_process

Number = Annotated[float, Strict()]


class TurningTable(BaseModel):
    """The table ``[turning]``, in place of ``[cutting]``: tool, workpiece and force coefficients.

    The structure's X is the direction of feed, Y that of the surface's motion at the tool, and Z points out of the
    workpiece, across feed and cutting speed.

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
    ktc_exponent
        Exponent m with which the tangential coefficient falls with the chip thickness h (Kienzle),
        ``ktc_pa (h / reference_chip_m)^-m``, 0 to below 1; 0: it does not. Typical: 0.2 to 0.3 for steel. An exponent
        needs ``feed_per_revolution_m`` and ``edge_radius_m``.
    krc_exponent
        Exponent of the radial coefficient, which is ``krc ktc_pa`` at ``reference_chip_m``; without it that of
        ``ktc_exponent``, so that ``krc`` holds at every chip thickness.
    kac_exponent
        Exponent of the axial coefficient, likewise.
    reference_chip_m : m
        Chip thickness at which ``ktc_pa``, ``krc`` and ``kac`` hold, above 0; 0.001 for Kienzle's kc1.1.
    edge_radius_m : m
        Radius of the cutting edges, 0 or more: for a thinner chip the force follows the tangent of the law. Typical:
        5e-6 to 20e-6 for carbide. Without an exponent it has no effect.
    process_damping_n_per_m : N/m
        Coefficient C of process damping, 0 or more: the force on the flank is ``C v_n / V`` per metre of edge, with v_n
        the speed into the surface and V the cutting speed. 0: no process damping, which is on the safe side.
    ktc_std_pa : Pa
        Standard error of ``ktc_pa``, below it; it enters the confidence bands of the limits. 0: not known.
    krc_std
        Standard error of ``krc``; 0: not known.
    kac_std
        Standard error of ``kac``; 0: not known.
    covariance
        Instead of the three standard errors: covariance of ``ktc_pa``, ``krc``, ``kac``, ``kte_n_per_m``,
        ``kre_n_per_m``, ``kae_n_per_m``, six rows in this order and these units, or nine with ``ktc_exponent``,
        ``krc_exponent``, ``kac_exponent``.
    """

    model_config = ConfigDict(extra="forbid", strict=False, allow_inf_nan=False)

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
    ktc_exponent: Number = 0.0
    krc_exponent: Number | None = None
    kac_exponent: Number | None = None
    reference_chip_m: Number = 1e-3
    edge_radius_m: Number = 0.0
    process_damping_n_per_m: Number = 0.0
    ktc_std_pa: Number = 0.0
    krc_std: Number = 0.0
    kac_std: Number = 0.0
    covariance: tuple[tuple[Number, ...], ...] = ()


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
