"""Sensors of the simulated laboratory: what each measures, where, and how imperfectly."""

import math
from dataclasses import dataclass

from acquisition import Channel
from foundation import SI_UNITS, DegreeOfFreedom, InputError

from ..robot_structure import HOUSING, TOOL_TIP


@dataclass(frozen=True)
class Sensor:
    """One channel: a quantity at a degree of freedom, with noise, range, resolution and high-pass.

    Parameters
    ----------
    name
        Name of the channel, such as ``fx``.
    quantity
        Measured quantity: ``force`` (on the tool, as a table dynamometer under the workpiece gives with its sign
        turned), ``acceleration``, ``velocity`` or ``displacement``.
    degree_of_freedom
        Node and direction of the sensor, such as ``TCP:+X``.
    noise
        White noise, as a share of the channel's own standard deviation.
    full_scale
        Largest magnitude, SI; larger values are clipped to it.
    bits
        Number of bits of the converter: steps of ``full_scale / 2^(bits - 1)``.
    high_pass_hz : Hz
        Corner of a first-order high-pass (IEPE supply); None: down to 0 Hz.

    Raises
    ------
    InputError
        A value that no sensor can have.
    """

    name: str
    quantity: str
    degree_of_freedom: str
    noise: float = 0.01
    full_scale: float = 500.0
    bits: int = 24
    high_pass_hz: float | None = None

    def __post_init__(self) -> None:
        DegreeOfFreedom.parse(self.degree_of_freedom)
        if not (math.isfinite(self.noise) and self.noise >= 0):
            raise InputError(f"sensor {self.name}: noise {self.noise!r} must be zero or more (0.01: 1 % of the signal)")
        if not (math.isfinite(self.full_scale) and self.full_scale > 0):
            raise InputError(f"sensor {self.name}: full scale {self.full_scale!r} must be positive")
        if not (isinstance(self.bits, int) and 2 <= self.bits <= 52):
            raise InputError(f"sensor {self.name}: {self.bits!r} bits; a converter has 2 to 52, most 16 or 24")
        if self.high_pass_hz is not None and not self.high_pass_hz > 0:
            raise InputError(f"sensor {self.name}: high-pass {self.high_pass_hz!r} Hz must be positive, or None")

    @property
    def resolution(self) -> float:
        """One step of the converter, SI."""
        return math.ldexp(self.full_scale, 1 - self.bits)

    def channel(self) -> Channel:
        """The recording's description of this sensor."""
        place = DegreeOfFreedom.parse(self.degree_of_freedom)
        return Channel(
            self.name,
            self.quantity,
            SI_UNITS.get(self.quantity, ""),
            place.node,
            place.direction,
            self.full_scale,
            self.high_pass_hz,
            "simulated",
        )


def dynamometer(noise: float = 0.01, full_scale: float = 500.0) -> tuple[Sensor, ...]:
    """Three forces on the tool, ``fx fy fz`` at ``TCP``; range in N, down to 0 Hz."""
    return tuple(
        Sensor(name, "force", place, noise, full_scale)
        for name, place in zip(("fx", "fy", "fz"), TOOL_TIP, strict=True)
    )


def housing_accelerometers(
    noise: float = 0.01, full_scale: float = 490.0, high_pass_hz: float | None = 0.1
) -> tuple[Sensor, ...]:
    """Three IEPE accelerometers on the spindle housing, ``ax ay az``; range in m/s^2 (490: 50 g)."""
    return _accelerometers(("ax", "ay", "az"), HOUSING, noise, full_scale, high_pass_hz)


def tip_accelerometers(
    noise: float = 0.01, full_scale: float = 490.0, high_pass_hz: float | None = 0.1
) -> tuple[Sensor, ...]:
    """Three IEPE accelerometers at the tool tip, ``tip_ax tip_ay tip_az``: for hammer tests, the spindle at rest."""
    return _accelerometers(("tip_ax", "tip_ay", "tip_az"), TOOL_TIP, noise, full_scale, high_pass_hz)


def milling_sensors(force_noise: float = 0.01, acceleration_noise: float = 0.01) -> tuple[Sensor, ...]:
    """Dynamometer and housing accelerometers: the six channels of an in-process test."""
    return dynamometer(force_noise) + housing_accelerometers(acceleration_noise)


def hammer_sensors(force_noise: float = 0.01, acceleration_noise: float = 0.01) -> tuple[Sensor, ...]:
    """Hammer force at the tip, accelerometers at housing and tip: the nine channels of a hammer test."""
    return (
        dynamometer(force_noise, 2000.0)
        + housing_accelerometers(acceleration_noise)
        + tip_accelerometers(acceleration_noise)
    )


def _accelerometers(
    names: tuple[str, ...], places: tuple[str, ...], noise: float, full_scale: float, high_pass_hz: float | None
) -> tuple[Sensor, ...]:
    return tuple(
        Sensor(name, "acceleration", place, noise, full_scale, high_pass_hz=high_pass_hz)
        for name, place in zip(names, places, strict=True)
    )
