"""`MillingProcess`: the cutter, its engagement and its force coefficients."""

import math
from dataclasses import dataclass

from foundation import InputError


@dataclass(frozen=True)
class MillingProcess:
    """One milling operation apart from its depth and spindle speed.

    Force on the tool in the frame of Mohammadi & Ahmadi, Fig. 1: X feed, Y normal, Z axial;
    immersion angle measured from +Y clockwise so that chip thickness is
    ``h = (dx sin(phi) + dy cos(phi)) sin(gamma) - dz cos(gamma)``.

    Parameters
    ----------
    teeth
        Number of cutting edges N >= 1.
    diameter
        Of the cutter, m.
    edge_angle
        Cutting edge angle gamma, rad, 0 < gamma <= pi/2 (pi/2: square end mill).
    ktc
        Tangential force coefficient K_tc, Pa.
    krc, kac
        Radial and axial coefficients as shares of ``ktc``.
    start_angle, exit_angle
        Immersion, rad, 0 <= start < exit <= pi.
    feed_per_tooth
        m.
    kte, kre, kae
        Edge coefficients, N/m of edge engaged.
    runout
        Radial offset of the spindle axis, m; tooth j runs ``runout * cos(2 pi j / teeth)`` large.

    Raises
    ------
    InputError
        A value outside these bounds.
    """

    teeth: int
    diameter: float
    edge_angle: float
    ktc: float
    krc: float
    kac: float
    start_angle: float
    exit_angle: float
    feed_per_tooth: float
    kte: float = 0.0
    kre: float = 0.0
    kae: float = 0.0
    runout: float = 0.0

    def __post_init__(self) -> None:
        if not (isinstance(self.teeth, int) and self.teeth >= 1):
            raise InputError(f"teeth = {self.teeth!r}: a cutter has a whole number of teeth, 1 or more")
        positive = {"diameter": self.diameter, "ktc": self.ktc}
        not_negative = {
            "feed_per_tooth": self.feed_per_tooth,
            "kte": self.kte,
            "kre": self.kre,
            "kae": self.kae,
            "runout": self.runout,
        }
        for name, value in positive.items():
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} = {value!r} must be positive and finite")
        for name, value in not_negative.items():
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name} = {value!r} must be zero or more, and finite")
        if not (math.isfinite(self.krc) and math.isfinite(self.kac)):
            raise InputError(f"krc = {self.krc!r}, kac = {self.kac!r} must be finite")
        if not 0 < self.edge_angle <= math.pi / 2 + 1e-12:
            raise InputError(f"edge angle {math.degrees(self.edge_angle):g} deg is outside 0 < gamma <= 90 deg")
        if not -1e-12 <= self.start_angle < self.exit_angle <= math.pi + 1e-12:
            raise InputError(
                f"immersion {math.degrees(self.start_angle):g} to {math.degrees(self.exit_angle):g} deg is not within "
                "0 <= start < exit <= 180 deg; swap or correct start_angle_deg and exit_angle_deg"
            )
