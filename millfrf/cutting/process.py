"""`MillingProcess`: cutter, engagement and force coefficients; turning as the edge that keeps its direction."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import accumulate

import numpy as np

from millfrf.core import InputError, Real
from millfrf.core.argument_types import checked_type

from .chip_law import CONSTANT_LAW, ChipLaw
from .profile import ProfileElement, check_profile

TURNING_IMMERSION = math.pi / 2  # rad; a tooth there has the feed along X, the cutting speed along Y, the depth along Z


@dataclass(frozen=True)
class MillingProcess:
    """One milling operation apart from its depth and spindle speed; :func:`milling_process` takes degrees.

    The force acts on the tool, in the frame of Mohammadi & Ahmadi, Fig. 1: X feed, Y normal, Z axial. The immersion
    angle is measured from +Y clockwise, so that the chip thickness is
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
        Radial offset of the spindle axis; the radius of tooth j is larger by ``runout * cos(2 pi j / teeth)``.
    helix_angle : rad
        Helix angle beta of the edges, 0 <= beta < pi/2. At height z an edge lags its tip by
        ``2 z tan(beta) / diameter``.
    pitch_angles : (teeth,), rad
        Angle from each tooth j to the one before it in the cut, j + 1; they add up to 2 pi. Empty: equal pitch.
    process_damping : N/m
        Coefficient C of the flank force ``C v_n / V`` per metre of edge, with v_n the speed into the surface and V the
        cutting speed (Tyler & Schmitz, Precision Engineering 37, 2013, Eq. 1).
    profile
        Elements of the cutter's profile from the tip upwards; empty: a cylinder with ``edge_angle``. With a profile
        coefficients count per width of the edge, as in textbooks; with ``edge_angle`` alone per depth (Mohammadi &
        Ahmadi, Eq. 1).
    helix_angles : (teeth,), rad
        Helix angle of each tooth where they differ; empty: ``helix_angle`` for all.
    serration_amplitude, serration_wavelength : m
        Radial wave of serrated edges along the axis, shifted by a tooth's share of a wave from tooth to tooth.
    ktc_std, krc_std, kac_std
        Standard errors of ``ktc`` (Pa), ``krc`` and ``kac``. Zero: not known.
    covariance : (6, 6) or (9, 9)
        Covariance of ``ktc, krc, kac, kte, kre, kae`` and of the three exponents of ``chip_law``, whose first three
        variances are those of the standard errors. Empty: the errors are taken as independent.
    is_turning
        Whether the workpiece turns and the only edge keeps its direction; :func:`turning_process` makes such a cut.
    chip_law
        Dependence of the force coefficients on the chip thickness; without it none.

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
    profile: tuple[ProfileElement, ...] = ()
    helix_angles: tuple[float, ...] = ()
    serration_amplitude: float = 0.0
    serration_wavelength: float = 0.0
    covariance: tuple[tuple[float, ...], ...] = ()
    is_turning: bool = False
    chip_law: ChipLaw = CONSTANT_LAW

    def __post_init__(self) -> None:
        self._check_types()
        if not (isinstance(self.teeth, int) and self.teeth >= 1):
            raise InputError(f"teeth = {self.teeth!r}: a cutter has a whole number of teeth, 1 or more")
        for name in ("diameter", "ktc"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise InputError(f"{name} = {value!r} must be positive and finite")
        for name in _NOT_NEGATIVE:
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name} = {value!r} must be zero or more, and finite")
        if not (math.isfinite(self.krc) and math.isfinite(self.kac)):
            raise InputError(f"krc = {self.krc!r}, kac = {self.kac!r} must be finite")
        if self.ktc_std >= self.ktc:
            raise InputError(
                f"ktc_std = {self.ktc_std:g} Pa is as large as ktc = {self.ktc:g} Pa; give the standard error in Pa, "
                "or measure the coefficient again"
            )
        if self.chip_law.varies and not self.feed_per_tooth:
            raise InputError(
                "force coefficients with an exponent depend on the chip thickness, which the feed decides; give "
                f"{'feed_per_revolution_m' if self.is_turning else 'feed_per_tooth_m'}"
            )
        self._check_angles()
        self._check_shape()
        if self.covariance:
            check_covariance(self.covariance)

    def _check_types(self) -> None:
        for field in fields(self):
            if field.type in (float, tuple[float, ...]):
                value = checked_type(field.name, getattr(self, field.name), field.type, _UNITS.get(field.name, ""))
                object.__setattr__(self, field.name, value)

    def _check_shape(self) -> None:
        check_profile(self.profile)
        if self.profile and abs(self.edge_angle - math.pi / 2) > 1e-9:
            raise InputError(
                f"edge angle {math.degrees(self.edge_angle):g} deg beside a profile of the cutter, which has its own; "
                "leave it at 90 deg"
            )
        if (self.serration_amplitude > 0) != (self.serration_wavelength > 0):
            raise InputError(
                f"serration of {self.serration_amplitude!r} m with a wavelength of {self.serration_wavelength!r} m: "
                "give both above 0, or neither"
            )
        if self.serration_amplitude and not self.feed_per_tooth:
            raise InputError("serrated edges leave the cut at a depth that the feed decides; give feed_per_tooth")

    def _check_angles(self) -> None:
        # 1e-12 rad: rounding where angles come from degrees or a radial depth
        if not 0 < self.edge_angle <= math.pi / 2 + 1e-12:
            raise InputError(f"edge angle {math.degrees(self.edge_angle):g} deg is outside 0 < gamma <= 90 deg")
        if self.is_turning:
            self._check_turning()
        elif not -1e-12 <= self.start_angle < self.exit_angle <= math.pi + 1e-12:
            in_radians = _IN_RADIANS if self.exit_angle > 2 * math.pi else ""
            raise InputError(
                f"immersion {math.degrees(self.start_angle):g} to {math.degrees(self.exit_angle):g} deg is not within "
                f"0 <= start < exit <= 180 deg; swap or correct start_angle_deg and exit_angle_deg{in_radians}"
            )
        for angle in (self.helix_angle, *self.helix_angles):
            if not 0 <= angle < math.pi / 2:
                raise InputError(f"helix angle {math.degrees(angle):g} deg is outside 0 <= beta < 90 deg")
        if len(self.helix_angles) not in (0, self.teeth):
            raise InputError(f"{len(self.helix_angles)} helix angles for {self.teeth} teeth; give one per tooth")
        if not self.pitch_angles:
            return
        if len(self.pitch_angles) != self.teeth:
            raise InputError(f"{len(self.pitch_angles)} pitch angles for {self.teeth} teeth; give one per tooth")
        if not min(self.pitch_angles) > 0 or abs(sum(self.pitch_angles) - 2 * math.pi) > 1e-6:
            degrees = ", ".join(f"{math.degrees(angle):g}" for angle in self.pitch_angles)
            raise InputError(f"pitch angles {degrees} deg must be positive and add up to 360 deg")

    def _check_turning(self) -> None:
        rotating = (self.helix_angle, *self.helix_angles, self.runout, self.serration_amplitude)
        if self.teeth != 1 or any(rotating):
            raise InputError("a turning tool has one edge without helix, runout and serration; leave these keys out")
        if (self.start_angle, self.exit_angle) != (0.0, 2 * math.pi):
            raise InputError("a turning tool is in the cut all the time; make the cut by turning_process")

    @property
    def helices(self) -> tuple[float, ...]:
        """Return the helix angle of each tooth, rad."""
        return self.helix_angles or (self.helix_angle,) * self.teeth

    @property
    def has_offsets(self) -> bool:
        """Check whether radial offsets of the edges decide which earlier tooth left the surface that a tooth cuts."""
        return self.serration_amplitude > 0 or self.runout_decides

    @cached_property
    def missed_shares(self) -> tuple[float, ...]:
        """Return for each tooth the share of the immersion in which the runout takes it out of the cut.

        Tooth j misses the cut where ``f_j sin(phi) < rho_(j+1) - rho_j`` with its feed f_j and the offsets rho.
        """
        if not (self.runout > 0 and self.feed_per_tooth > 0 and self.teeth > 1):
            return (0.0,) * self.teeth
        offsets = [self.runout * math.cos(2 * math.pi * j / self.teeth) for j in range(self.teeth)]
        angles = [self.start_angle + (self.exit_angle - self.start_angle) * (i + 0.5) / 180 for i in range(180)]
        shares = []
        for tooth, feed in enumerate(self.tooth_feeds):
            thinnest = (offsets[(tooth + 1) % self.teeth] - offsets[tooth]) / feed
            shares.append(sum(math.sin(angle) < thinnest for angle in angles) / 180)
        return tuple(shares)

    @property
    def runout_decides(self) -> bool:
        """Check whether runout takes a tooth out of most of its cut: then others cut what several teeth left."""
        return max(self.missed_shares) > 0.5

    @property
    def is_cylinder(self) -> bool:
        """Check whether all edges have the same helix and radius, so that each cuts what the tooth before it left."""
        return not (self.profile or self.has_offsets or len(set(self.helices)) > 1)

    @property
    def pitches(self) -> tuple[float, ...]:
        """Return the angle from each tooth j to tooth j + 1, which cuts before tooth j, rad."""
        return self.pitch_angles or (2 * math.pi / self.teeth,) * self.teeth

    @property
    def tooth_feeds(self) -> tuple[float, ...]:
        """Return the feed between each tooth and the one before it, m."""
        return tuple(self.feed_per_tooth * self.teeth * pitch / (2 * math.pi) for pitch in self.pitches)

    @property
    def tooth_angles(self) -> tuple[float, ...]:
        """Return the angle by which each tooth is ahead of tooth 0, rad."""
        return tuple(accumulate(self.pitches[:-1], initial=0.0))

    @property
    def equal_pitch(self) -> bool:
        """Check whether all angles between neighbouring teeth are equal."""
        return max(self.pitches) - min(self.pitches) < 1e-9

    @property
    def thickest_chip(self) -> float:
        """Return the largest chip thickness, m, without vibration and runout: ``feed * max sin(phi)`` in the cut."""
        top = min(max(math.pi / 2, self.start_angle), self.exit_angle)
        return self.feed_per_tooth * math.sin(top)

    @property
    def largest_stiffness(self) -> float:
        """Return the largest change of force per chip thickness and width of an edge, Pa, over all chips."""
        slopes = self.chip_law.slopes(np.zeros(1))[0]
        return float(self.ktc * np.linalg.norm(slopes * np.array([1.0, self.krc, self.kac])))

    @property
    def has_constant_force(self) -> bool:
        """Return whether the forces of equal teeth sum to a constant, as in a slot with four teeth.

        The force of a tooth has harmonics of the angle up to the second; the sum of three or more teeth, engaged over a
        whole number of pitches, keeps its mean alone.
        """
        pitches = (self.exit_angle - self.start_angle) * self.teeth / (2 * math.pi)
        return self.teeth >= 3 and not self.pitch_angles and abs(pitches - round(pitches)) < 1e-6

    @property
    def coefficient_errors(self) -> tuple[float, float, float]:
        """Return the standard errors of ``ktc`` (Pa), ``krc`` and ``kac``; zero means not known."""
        return (self.ktc_std, self.krc_std, self.kac_std)

    @property
    def coefficient_covariance(self) -> Real:
        """Return the covariance of ``ktc``, ``krc``, ``kac`` and their exponents, (6, 6), with the stated errors."""
        whole = np.zeros((9, 9))
        whole[: len(self.covariance), : len(self.covariance)] = np.array(self.covariance or np.zeros((0, 0)))
        known = whole[np.ix_(_OF_LIMITS, _OF_LIMITS)]
        scale = np.sqrt(np.maximum(np.diag(known), 1e-300))
        errors = np.append(self.coefficient_errors, scale[3:])
        if not self.covariance:
            return np.diag(errors**2)
        return np.asarray(known / np.outer(scale, scale) * np.outer(errors, errors))

    @property
    def is_plain(self) -> bool:
        """Check whether edges are straight, at equal pitch and without process damping.

        The force of such a cut is linear in depth and has a single delay.
        """
        return self.is_cylinder and max(self.helices) == 0 and self.equal_pitch and self.process_damping == 0

    @property
    def is_helical(self) -> bool:
        """Check whether the edges differ from those of a plain cut by their helix only, if at all.

        Then the harmonics of the directional matrix are those of straight edges, each smaller by a factor.
        """
        return self.is_cylinder and self.equal_pitch and self.process_damping == 0

    def lag(self, depth: float) -> float:
        """Return the angle (rad) by which an edge at the height ``depth`` (m) lags behind its tip."""
        return 2 * depth * math.tan(max(self.helices)) / self.diameter


_UNITS = {
    **dict.fromkeys(("diameter", "feed_per_tooth", "runout", "serration_amplitude", "serration_wavelength"), "m"),
    **dict.fromkeys(("edge_angle", "start_angle", "exit_angle", "helix_angle", "pitch_angles", "helix_angles"), "rad"),
    **dict.fromkeys(("kte", "kre", "kae", "process_damping"), "N/m"),
    **dict.fromkeys(("ktc", "ktc_std"), "Pa"),
}
_IN_RADIANS = "; MillingProcess takes radians, milling_process degrees"
_OF_LIMITS = (0, 1, 2, 6, 7, 8)  # rows of the covariance that enter limits: all but the edge forces
_NOT_NEGATIVE = (
    "feed_per_tooth", "kte", "kre", "kae", "runout", "process_damping", "ktc_std", "krc_std", "kac_std",
    "serration_amplitude", "serration_wavelength",
)  # fmt: skip


def check_covariance(rows: Sequence[Sequence[float]]) -> None:
    """Refuse a covariance of the six coefficients, and of their exponents, that no errors can have.

    Raises
    ------
    InputError
        Neither six by six nor nine by nine, not symmetric, or with a negative variance in some direction.
    """
    if len(rows) not in (6, 9) or {len(row) for row in rows} != {len(rows)}:
        raise InputError(
            "covariance: give 6 rows of 6 numbers, for ktc, krc, kac, kte, kre and kae, or 9 with their exponents too"
        )
    matrix = np.array(rows)
    scale = np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    scaled = matrix / np.outer(scale, scale)
    if not np.isfinite(matrix).all() or np.abs(scaled - scaled.T).max() > 1e-6:
        raise InputError("covariance: the matrix is not symmetric, or not finite; give cov(a, b) and cov(b, a) alike")
    if np.linalg.eigvalsh(scaled).min() < -1e-6:
        raise InputError("covariance: no errors have this matrix, a correlation in it is beyond 1; check its numbers")


def immersion_angles(kind: str, radial_depth: float, diameter: float) -> tuple[float, float]:
    """Return the immersion angles of a cutter from its radial depth of cut.

    Up milling starts at 0, where the chip is thin, and ends at ``acos(1 - 2 b / D)``. Down milling is the mirror image
    of up milling. A central cut is symmetric about pi/2 (Altintas, Manufacturing Automation, 2nd ed., section 2.6).

    Parameters
    ----------
    kind
        Type of cut: ``up``, ``down``, ``slot`` or ``central``.
    radial_depth : m
        Radial depth of cut b; it has no effect in a slot.
    diameter : m
        Diameter D of the cutter.

    Returns
    -------
    start, exit
        Immersion angles, rad.

    Raises
    ------
    InputError
        An unknown kind, or a radial depth outside 0 < b <= D.

    Examples
    --------
    >>> [round(math.degrees(angle)) for angle in immersion_angles("down", 0.005, 0.01)]
    [90, 180]
    """
    if kind not in ("up", "down", "slot", "central"):
        raise InputError(f"immersion {kind!r} is not known; use one of up, down, slot, central")
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
