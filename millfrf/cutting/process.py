"""`MillingProcess`: cutter, engagement and force coefficients."""

import math
from collections.abc import Collection
from dataclasses import dataclass
from itertools import accumulate

from millfrf.core import InputError


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
    diameter : m
        Diameter of the cutter.
    edge_angle : rad
        Cutting edge angle gamma, 0 < gamma <= pi/2 (pi/2: square end mill).
    ktc : Pa
        Tangential force coefficient K_tc.
    krc, kac
        Radial and axial coefficients as shares of ``ktc``.
    start_angle, exit_angle : rad
        Immersion angles at which a tooth enters and leaves, 0 <= start < exit <= pi.
    feed_per_tooth : m
        Feed per tooth.
    kte, kre, kae : N/m
        Tangential, radial and axial edge coefficients, force per metre of engaged edge.
    runout : m
        Radial offset of the spindle axis; tooth j runs ``runout * cos(2 pi j / teeth)`` large.
    helix_angle : rad
        Helix angle beta of the edges, 0 <= beta < pi/2; at the height z an edge stands ``2 z tan(beta) / diameter``
        behind its tip.
    pitch_angles : (teeth,), rad
        Angle from each tooth j to the one before it in the cut, j + 1; they add up to 2 pi. Empty: equal pitch.
    process_damping : N/m
        Coefficient C: the flank takes ``C v_n / V`` per metre of edge, with v_n the speed into the surface and V the
        cutting speed (Tyler & Schmitz, Precision Engineering 37, 2013, Eq. 1).
    ktc_std, krc_std, kac_std
        Standard errors of ``ktc`` (Pa), ``krc`` and ``kac``, taken as independent of each other. Zero: not known.

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
    helix_angle: float = 0.0
    pitch_angles: tuple[float, ...] = ()
    process_damping: float = 0.0
    ktc_std: float = 0.0
    krc_std: float = 0.0
    kac_std: float = 0.0

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
            "process_damping": self.process_damping,
            "ktc_std": self.ktc_std,
            "krc_std": self.krc_std,
            "kac_std": self.kac_std,
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
        if not 0 <= self.helix_angle < math.pi / 2:
            raise InputError(f"helix angle {math.degrees(self.helix_angle):g} deg is outside 0 <= beta < 90 deg")
        self._check_errors()
        self._check_pitch()

    def _check_errors(self) -> None:
        if self.ktc_std >= self.ktc:
            raise InputError(
                f"ktc_std = {self.ktc_std:g} Pa is as large as ktc = {self.ktc:g} Pa; give the standard error in Pa, "
                "or measure the coefficient again"
            )

    def _check_pitch(self) -> None:
        if not self.pitch_angles:
            return
        if len(self.pitch_angles) != self.teeth:
            raise InputError(f"{len(self.pitch_angles)} pitch angles for {self.teeth} teeth; give one a tooth")
        degrees = ", ".join(f"{math.degrees(angle):g}" for angle in self.pitch_angles)
        if not min(self.pitch_angles) > 0 or abs(sum(self.pitch_angles) - 2 * math.pi) > 1e-6:
            raise InputError(f"pitch angles {degrees} deg must be positive and add up to 360 deg")

    @property
    def pitches(self) -> tuple[float, ...]:
        """Angle from each tooth j to the one before it in the cut, j + 1, rad."""
        return self.pitch_angles or (2 * math.pi / self.teeth,) * self.teeth

    @property
    def tooth_angles(self) -> tuple[float, ...]:
        """Angle of each tooth ahead of tooth 0, rad."""
        return tuple(accumulate(self.pitches[:-1], initial=0.0))

    @property
    def equal_pitch(self) -> bool:
        """Whether all teeth follow each other at the same angle."""
        return max(self.pitches) - min(self.pitches) < 1e-9

    @property
    def thickest_chip(self) -> float:
        """Give the thickest chip, m, of a tool that does not vibrate and has no runout: ``feed * max sin(phi)``."""
        top = min(max(math.pi / 2, self.start_angle), self.exit_angle)
        return self.feed_per_tooth * math.sin(top)

    @property
    def coefficient_errors(self) -> tuple[float, float, float]:
        """Standard errors of ``ktc`` (Pa), ``krc`` and ``kac``; all zero where the file gives none."""
        return (self.ktc_std, self.krc_std, self.kac_std)

    @property
    def is_plain(self) -> bool:
        """Straight edges at equal pitch without process damping: force linear in depth, one delay."""
        return self.helix_angle == 0 and self.equal_pitch and self.process_damping == 0

    def lag(self, depth: float) -> float:
        """Angle by which an edge at the height ``depth`` (m) stands behind its tip, rad."""
        return 2 * depth * math.tan(self.helix_angle) / self.diameter


IMMERSIONS = ("up", "down", "slot", "central")


def immersion_angles(kind: str, radial_depth: float, diameter: float) -> tuple[float, float]:
    """Give the immersion of a cutter that takes ``radial_depth`` (m) of its diameter.

    Up milling enters at 0 with no chip and leaves at ``acos(1 - 2 b / D)``; down milling is its mirror image; a central
    cut lies evenly about pi/2 (Altintas, Manufacturing Automation, 2nd ed., section 2.6).

    Parameters
    ----------
    kind
        Way the cutter is led: ``up``, ``down``, ``slot`` or ``central``.
    radial_depth : m
        Radial depth of cut b; it has no effect in a slot.
    diameter : m
        Diameter D of the cutter.

    Returns
    -------
    start, exit
        rad.

    Raises
    ------
    InputError
        An unknown kind, or a radial depth outside 0 < b <= D.

    Examples
    --------
    >>> [round(math.degrees(angle)) for angle in immersion_angles("down", 0.005, 0.01)]
    [90, 180]
    """
    if kind not in IMMERSIONS:
        raise InputError(f"immersion {kind!r} is not known; use one of {', '.join(IMMERSIONS)}")
    if kind == "slot":
        return 0.0, math.pi
    if not 0 < radial_depth <= diameter:
        raise InputError(
            f"radial depth {radial_depth!r} m must be above 0 and at most the diameter, {diameter:g} m; "
            "give metres, not mm"
        )
    width = math.acos(1 - 2 * radial_depth / diameter)
    if kind == "up":
        return 0.0, width
    if kind == "down":
        return math.pi - width, math.pi
    half = math.asin(radial_depth / diameter)
    return math.pi / 2 - half, math.pi / 2 + half


def refuse_varied(process: MillingProcess, what: str, remedy: str, *, takes: Collection[str] = ()) -> None:
    """Refuse a helix, an unequal pitch or process damping unless ``what`` takes it.

    Parameters
    ----------
    process
        Milling process to check.
    what
        Name of the calculation; it is the subject of the message.
    remedy
        What to do instead.
    takes
        Those of ``helix``, ``pitch`` and ``damping`` that the calculation covers.

    Raises
    ------
    InputError
        With the first that is not covered.
    """
    present = {
        "helix": (process.helix_angle != 0, "helical edges"),
        "pitch": (not process.equal_pitch, "unequal pitch"),
        "damping": (process.process_damping != 0, "process damping"),
    }
    for name, (given, words) in present.items():
        if given and name not in takes:
            raise InputError(f"{what} does not take {words}; {remedy}")
