"""The simulated laboratory: sensors, signal chain, and the description of the set-up."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from acquisition import Channel
from millfrf.core import HOUSING, SI_UNITS, TIP, DegreeOfFreedom, InputError, Real
from millfrf.cutting import MillingProcess

from .settings import SETTINGS

# A two-fluted 12.7 mm end mill in acetal, half-immersion down-milling (Mohammadi & Ahmadi); the runout is assumed.
ACETAL_CUTTER = MillingProcess(
    teeth=2,
    diameter=12.7e-3,
    edge_angle=math.pi / 2,
    ktc=119e6,
    krc=0.17,
    kac=0.33,
    start_angle=math.pi / 2,
    exit_angle=math.pi,
    feed_per_tooth=0.15e-3,
    runout=10e-6,
)

# start and exit angles over pi of three sweeps with independent forces (Mohammadi & Ahmadi)
SWEEP_IMMERSIONS = {"central": (0.38, 0.61), "down": (0.77, 1.0), "up": (0.0, 0.23)}

_FORCE_NAMES, _HOUSING_NAMES, _TIP_NAMES = ("fx", "fy", "fz"), ("ax", "ay", "az"), ("tip_ax", "tip_ay", "tip_az")


@dataclass(frozen=True)
class Sensor:
    """One channel: quantity, degree of freedom, noise, range, resolution and high-pass of a sensor.

    Parameters
    ----------
    name
        Name of the channel, such as ``fx``.
    quantity
        Measured quantity: ``force`` (on the tool; a table dynamometer under the workpiece gives it with the opposite
        sign), ``acceleration``, ``velocity`` or ``displacement``.
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
        """Return one step of the converter, SI."""
        return math.ldexp(self.full_scale, 1 - self.bits)

    def channel(self) -> Channel:
        """Return the channel that describes this sensor in a recording."""
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
    """Return three force sensors on the tool, ``fx fy fz`` at ``TCP``, valid down to 0 Hz; ``full_scale`` in N."""
    return tuple(Sensor(name, "force", dof, noise, full_scale) for name, dof in zip(_FORCE_NAMES, TIP, strict=True))


def housing_accelerometers(
    noise: float = 0.01, full_scale: float = 490.0, high_pass_hz: float | None = 0.1
) -> tuple[Sensor, ...]:
    """Return three IEPE accelerometers on the spindle housing, ``ax ay az``; ``full_scale`` in m/s^2 (490: 50 g)."""
    return _accelerometers(_HOUSING_NAMES, HOUSING, noise, full_scale, high_pass_hz)


def tip_accelerometers(
    noise: float = 0.01, full_scale: float = 490.0, high_pass_hz: float | None = 0.1
) -> tuple[Sensor, ...]:
    """Return three IEPE accelerometers at the tool tip, ``tip_ax tip_ay tip_az``, for taps with the spindle at rest."""
    return _accelerometers(_TIP_NAMES, TIP, noise, full_scale, high_pass_hz)


def milling_sensors(force_noise: float = 0.01, acceleration_noise: float = 0.01) -> tuple[Sensor, ...]:
    """Return dynamometer and housing accelerometers: the six channels of a test in the cut."""
    return dynamometer(force_noise) + housing_accelerometers(acceleration_noise)


def hammer_sensors(force_noise: float = 0.01, acceleration_noise: float = 0.01) -> tuple[Sensor, ...]:
    """Return hammer force at the tip, accelerometers at housing and tip: the nine channels of a hammer test."""
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


Plain = str | float | bool | Sequence[float]  # value of an entry of a set-up


def setup_text(tables: Mapping[str, Mapping[str, Plain]]) -> str:
    """Write tables of plain values as TOML text.

    Examples
    --------
    >>> print(setup_text({"cut": {"depth_m": 0.002, "material": "porous"}}), end="")
    [cut]
    depth_m = 0.002
    material = "porous"
    """
    lines = []
    for table, entries in tables.items():
        lines += [f"[{table}]", *(f"{key} = {_toml_value(value)}" for key, value in entries.items()), ""]
    return "\n".join(lines[:-1]) + "\n" if lines else ""


def cutting_table(process: MillingProcess) -> dict[str, str | float]:
    """Return the process under the keys of a cutting file, so that the set-up can be read as a cutting file."""
    entries: dict[str, str | float] = {
        "teeth": process.teeth,
        "diameter_m": process.diameter,
        "edge_angle_deg": _degrees(process.edge_angle),
        "ktc_pa": process.ktc,
        "krc": process.krc,
        "kac": process.kac,
        "start_angle_deg": _degrees(process.start_angle),
        "exit_angle_deg": _degrees(process.exit_angle),
        "feed_per_tooth_m": process.feed_per_tooth,
    }
    optional = {
        "kte_n_per_m": process.kte,
        "kre_n_per_m": process.kre,
        "kae_n_per_m": process.kae,
        "runout_m": process.runout,
    }
    return entries | {key: value for key, value in optional.items() if value}


def _degrees(angle: float) -> float:
    return round(math.degrees(angle), 9)


def _toml_value(value: Plain) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, Sequence):
        return f"[{', '.join(_toml_value(number) for number in value)}]"
    return repr(value if isinstance(value, int) else float(value))


class Decimator:
    """Filter against aliases and reduce the sample rate by the integer ``factor``, block by block, without delay.

    The filter is a symmetric FIR filter (Kaiser window, -6 dB at 0.8 of the new Nyquist frequency, stop band -80 dB)
    whose delay is removed, so that output sample m belongs to the time of input sample ``m factor``. The output
    therefore lags its input by ``lookahead`` samples.
    """

    def __init__(self, factor: int, n_channels: int) -> None:
        self._factor = factor
        self.lookahead = SETTINGS.filter_half_width * factor if factor > 1 else 0
        self._coefficients = anti_alias_filter(factor)
        self._pending = np.zeros((self.lookahead, n_channels))  # the input before the first sample is zero

    def __call__(self, samples: Real) -> Real:
        """Add input samples (n, n_channels) and return the output samples that can be computed by now."""
        if self._factor == 1:
            return samples
        pending = np.concatenate([self._pending, samples])
        n_output = (len(pending) - 2 * self.lookahead - 1) // self._factor + 1
        if n_output <= 0:
            self._pending = pending
            return np.empty((0, pending.shape[1]))
        used = pending[: 2 * self.lookahead + (n_output - 1) * self._factor + 1]
        first = 2 * self.lookahead // self._factor
        filtered = scipy.signal.upfirdn(self._coefficients, used, down=self._factor, axis=0)
        self._pending = pending[n_output * self._factor :].copy()
        return np.asarray(filtered[first : first + n_output])


def anti_alias_filter(factor: int) -> Real:
    """Return the coefficients of the low-pass, (2 half_width factor + 1,), gain 1 at 0 Hz."""
    if factor == 1:
        return np.ones(1)
    length = 2 * SETTINGS.filter_half_width * factor + 1
    window = ("kaiser", SETTINGS.kaiser_beta)
    return np.asarray(scipy.signal.firwin(length, SETTINGS.passed_share / factor, window=window))


class SignalChain:
    """Apply high-pass, noise, clipping and rounding to every channel, block by block, repeatable by seed.

    ``noise_rms`` (n_channels,) is the standard deviation of the white noise, SI.
    """

    def __init__(self, sensors: Sequence[Sensor], sample_rate: float, noise_rms: Real, seed: int) -> None:
        self._generator = np.random.default_rng(seed)
        self._noise = np.asarray(noise_rms, dtype=float)
        self._full_scale = np.array([sensor.full_scale for sensor in sensors])
        self._resolution = np.array([sensor.resolution for sensor in sensors])
        self._high_pass = _HighPass([sensor.high_pass_hz for sensor in sensors], sample_rate)

    def __call__(self, samples: Real) -> Real:
        """Convert physical values (n_samples, n_channels) to recorded values."""
        measured = self._high_pass(samples)
        if self._noise.any():
            measured = measured + self._generator.standard_normal(measured.shape) * self._noise
        steps = np.rint(np.clip(measured, -self._full_scale, self._full_scale) / self._resolution)
        return np.asarray(steps * self._resolution)


class _HighPass:
    """Apply a first-order high-pass ``s / (s + 2 pi corner)`` to each channel by the bilinear transform; None: none."""

    def __init__(self, corners: Sequence[float | None], sample_rate: float) -> None:
        self._groups: list[tuple[list[int], Real, Real]] = []  # columns of one corner, numerator, denominator
        self._state: list[Real] = []
        for corner in sorted({c for c in corners if c is not None}):
            columns = [index for index, c in enumerate(corners) if c == corner]
            ratio = np.pi * corner / sample_rate
            numerator = np.array([1.0, -1.0]) / (1 + ratio)
            self._groups.append((columns, numerator, np.array([1.0, (ratio - 1) / (ratio + 1)])))
            self._state.append(np.zeros((1, len(columns))))

    def __call__(self, samples: Real) -> Real:
        output = samples.copy()
        for index, (columns, numerator, denominator) in enumerate(self._groups):
            output[:, columns], self._state[index] = scipy.signal.lfilter(
                numerator, denominator, samples[:, columns], axis=0, zi=self._state[index]
            )
        return output
