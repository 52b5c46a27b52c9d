"""Turning and boring: cuts whose only edge keeps its direction while the workpiece turns."""

import math
from typing import Any

from millfrf.core import InputError

from .process import MillingProcess
from .profile import ProfileElement


def turning_process(
    diameter: float,
    edge_angle: float,
    ktc: float,
    krc: float,
    kac: float = 0.0,
    *,
    feed: float = 0.0,
    nose_radius: float = 0.0,
    **coefficients: Any,
) -> MillingProcess:
    """Describe a turning or boring cut as a milling tooth that stays at an immersion of 90 deg.

    The structure's X is the direction of feed, Y that of the surface's motion at the tool, and Z points out of the
    workpiece. An edge at the angle gamma cuts the chip ``h = f sin(gamma)`` and the width ``a / sin(gamma)`` at the
    depth a; a motion of the tool changes the chip by ``dx sin(gamma) - dz cos(gamma)``. The chip of one revolution
    before is the only delay, so that limits are those of a loop with constant coefficients (Altintas, Manufacturing
    Automation, 2nd ed., section 4.2).

    Parameters
    ----------
    diameter : m
        Diameter of the workpiece; it enters the cutting speed and so the process damping alone.
    edge_angle : rad
        Angle gamma between the edge and the direction of feed, the approach angle, 0 < gamma <= pi/2.
    ktc : Pa
        Force coefficient along the cutting speed, per width of the edge and chip thickness.
    krc, kac
        Coefficients normal to the edge and along it, as shares of ``ktc``.
    feed : m
        Feed per revolution.
    nose_radius : m
        Nose radius of the insert; the edge turns from 0 to ``edge_angle`` along it.
    **coefficients
        Other coefficients of :class:`MillingProcess`: edge forces, process damping, standard errors, covariance.

    Raises
    ------
    InputError
        A value out of its range.

    Examples
    --------
    >>> from millfrf.cutting import average_directional_matrix
    >>> orthogonal = turning_process(0.05, math.pi / 2, 2e9, 0.3)
    >>> average_directional_matrix(orthogonal)[:2, 0].round(3).tolist()
    [-0.3, 1.0]
    """
    if not (math.isfinite(nose_radius) and nose_radius >= 0):
        raise InputError(f"nose radius {nose_radius!r} m must be zero or more, and finite")
    profile: tuple[ProfileElement, ...] = ()
    if nose_radius:
        if not 0 < edge_angle <= math.pi / 2 + 1e-12:
            raise InputError(f"edge angle {math.degrees(edge_angle):g} deg is outside 0 < gamma <= 90 deg")
        nose = ProfileElement(diameter / 2, 0.0, nose_radius * edge_angle, 1 / nose_radius)
        profile = (nose, ProfileElement(nose.radius_at(nose.length), edge_angle))
        edge_angle = math.pi / 2
    return MillingProcess(
        1, diameter, edge_angle, ktc, krc, kac, 0.0, 2 * math.pi, feed, profile=profile, is_turning=True, **coefficients
    )


def nose_radius_of(process: MillingProcess) -> float:
    """Return the nose radius of a turning tool, m; 0: a straight edge."""
    return 1 / process.profile[0].curvature if process.profile else 0.0


def approach_angle_of(process: MillingProcess) -> float:
    """Return the edge angle, rad, which a nose radius of a turning tool moves into the profile."""
    return process.profile[-1].edge_angle if process.is_turning and process.profile else process.edge_angle
