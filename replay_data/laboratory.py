"""The simulated laboratory: sensors, signal chain, and its notes on the set-up."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Channel
from millfrf.core import HOUSING, SI_UNITS, TIP, DegreeOfFreedom, InputError
from millfrf.cutting import MillingProcess

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
"""A two-fluted 12.7 mm end mill in acetal, half-immersion down-milling (Mohammadi & Ahmadi); the runout is ours."""

SWEEP_IMMERSIONS = {"central": (0.38, 0.61), "down": (0.77, 1.0), "up": (0.0, 0.23)}
"""Start and exit angles of three sweeps over pi, whose forces are independent (ibid.)."""


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
        Sensor(name, "force", place, noise, full_scale) for name, place in zip(("fx", "fy", "fz"), TIP, strict=True)
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
    return _accelerometers(("tip_ax", "tip_ay", "tip_az"), TIP, noise, full_scale, high_pass_hz)


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


Plain = str | float | bool | Sequence[float]
"""What a set-up may say of one thing: a word, a number, yes or no, or a row of numbers."""


def setup_text(tables: Mapping[str, Mapping[str, Plain]]) -> str:
    """TOML text of tables of plain values.

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
    """The process under the keys of a cutting file, so that the set-up can be read as one."""
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
        return f"[{', '.join(_toml_value(part) for part in value)}]"
    return repr(int(value)) if isinstance(value, int) else repr(float(value))


HALF_WIDTH = 8
"""Half the length of the anti-alias filter, in samples of its output."""

_PASSED_SHARE = 0.8
_KAISER_BETA = 7.9


class Decimator:
    """Anti-alias filter and reduction of the sample rate by a whole factor, block by block, without delay.

    A symmetric FIR filter (Kaiser window, -6 dB at 0.8 of the new Nyquist frequency, stop band -80 dB); its delay is
    taken out, so that output sample m belongs to the time of input sample ``m factor``. Output lags the input it has
    been given by :attr:`lookahead` samples.

    Parameters
    ----------
    factor
        Number of input samples per output sample; 1 passes everything on.
    n_channels
        Number of columns of the samples.
    """

    def __init__(self, factor: int, n_channels: int) -> None:
        self._factor = factor
        self.lookahead = HALF_WIDTH * factor if factor > 1 else 0
        self._taps = anti_alias_filter(factor)
        self._held = np.zeros((self.lookahead, n_channels))

    def __call__(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Output samples that the input so far determines; before the first sample the input was zero."""
        if self._factor == 1:
            return samples
        held = np.concatenate([self._held, samples])
        ready = (len(held) - 2 * self.lookahead - 1) // self._factor + 1
        if ready <= 0:
            self._held = held
            return np.empty((0, held.shape[1]))
        used = held[: 2 * self.lookahead + (ready - 1) * self._factor + 1]
        first = 2 * self.lookahead // self._factor
        filtered = scipy.signal.upfirdn(self._taps, used, down=self._factor, axis=0)
        self._held = held[ready * self._factor :].copy()
        return np.asarray(filtered[first : first + ready])


def anti_alias_filter(factor: int) -> NDArray[np.float64]:
    """Coefficients of the low-pass, shape (2 HALF_WIDTH factor + 1,), gain 1 at 0 Hz."""
    if factor == 1:
        return np.ones(1)
    length = 2 * HALF_WIDTH * factor + 1
    return np.asarray(scipy.signal.firwin(length, _PASSED_SHARE / factor, window=("kaiser", _KAISER_BETA)))


class SignalChain:
    """High-pass, noise, clipping and rounding of every channel, block by block, repeatable by seed.

    Parameters
    ----------
    sensors
        Sensors, one a channel.
    sample_rate : Hz
        Samples a second.
    noise_rms : (n_channels,)
        Standard deviation of the white noise, SI.
    seed
        Seed of the noise.
    """

    def __init__(
        self, sensors: Sequence[Sensor], sample_rate: float, noise_rms: NDArray[np.float64], seed: int
    ) -> None:
        self._generator = np.random.default_rng(seed)
        self._noise = np.asarray(noise_rms, dtype=float)
        self._full_scale = np.array([sensor.full_scale for sensor in sensors])
        self._resolution = np.array([sensor.resolution for sensor in sensors])
        self._high_pass = _HighPass([sensor.high_pass_hz for sensor in sensors], sample_rate)

    def __call__(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """What the converter writes for these physical values, (n, n_channels)."""
        seen = self._high_pass(samples)
        if self._noise.any():
            seen = seen + self._generator.standard_normal(seen.shape) * self._noise
        return np.asarray(quantised(seen, self._full_scale, self._resolution))


def quantised(
    values: NDArray[np.float64], full_scale: NDArray[np.float64] | float, resolution: NDArray[np.float64] | float
) -> NDArray[np.float64]:
    """Clip to +-full_scale and round to whole multiples of the resolution.

    Examples
    --------
    >>> quantised(np.array([0.26, -9.0]), 1.0, 0.25).tolist()
    [0.25, -1.0]
    """
    steps = np.rint(np.clip(values, -full_scale, full_scale) / resolution)
    return np.asarray(steps * resolution)


class _HighPass:
    """First-order high-pass ``s / (s + 2 pi corner)`` per channel, bilinear transform; channels without pass."""

    def __init__(self, corners: Sequence[float | None], sample_rate: float) -> None:
        self._groups: list[tuple[list[int], NDArray[np.float64], NDArray[np.float64]]] = []
        self._state: list[NDArray[np.float64]] = []
        for corner in sorted({c for c in corners if c is not None}):
            columns = [index for index, c in enumerate(corners) if c == corner]
            share = np.pi * corner / sample_rate
            numerator = np.array([1.0, -1.0]) / (1 + share)
            self._groups.append((columns, numerator, np.array([1.0, (share - 1) / (share + 1)])))
            self._state.append(np.zeros((1, len(columns))))

    def __call__(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        if not self._groups:
            return samples
        output = samples.copy()
        for index, (columns, numerator, denominator) in enumerate(self._groups):
            output[:, columns], self._state[index] = scipy.signal.lfilter(
                numerator, denominator, samples[:, columns], axis=0, zi=self._state[index]
            )
        return output
