"""`HammerCell`: taps with an instrumented hammer on a robot at rest."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from foundation import InputError
from modal_fit import ModalModel

from .laboratory.sensors import Sensor, hammer_sensors
from .laboratory.setup_notes import setup_text
from .robot_structure import TOOL_TIP
from .sampled_cell import March, SampledCell
from .simulation.modal_integrator import discretise, respond

LEAD = 0.05
"""Quiet time before the first tap, s."""


class HammerCell(SampledCell):
    """Half-sine taps at the tool tip, direction by direction, each followed by its ring-down.

    Each tap is ``F(t) = A sin(pi (t - t0) / width)`` for ``0 < t - t0 < width``; A varies by 15 % and t0 by up to a
    sample, as by hand. The force channels carry the tap, the others the response, so that both H_TT (motion at the tip)
    and H_ST (motion at the housing) can be estimated (Mohammadi & Ahmadi, "Calibration of TCP FRF").

    Parameters
    ----------
    structure
        Modal model (receptance) with excitations ``TCP:+X +Y +Z`` and the responses the sensors need.
    directions
        Degrees of freedom to tap, in this order, among ``TCP:+X +Y +Z``.
    taps
        Number of taps in each direction.
    spacing : s
        Time between taps; a segment of this length holds one tap and its ring-down.
    peak : N
        Mean amplitude A of the taps.
    width : s
        Duration of the half sine; 4 ms (a soft tip) excites up to about 250 Hz.
    sample_rate, sensors, seed, oversampling, block_length
        Options of the same names in :class:`MillingCell`; default sensors :func:`hammer_sensors`.

    Raises
    ------
    InputError
        A value that cannot be.

    Examples
    --------
    >>> from replay_data import default_structure
    >>> cell = HammerCell(default_structure(), taps=1, spacing=0.5)
    >>> [channel.name for channel in cell.streams[0].channels]
    ['fx', 'fy', 'fz', 'ax', 'ay', 'az', 'tip_ax', 'tip_ay', 'tip_az']
    >>> cell.n_samples
    15360
    """

    def __init__(
        self,
        structure: ModalModel,
        *,
        directions: Sequence[str] = TOOL_TIP,
        taps: int = 5,
        spacing: float = 4.0,
        peak: float = 200.0,
        width: float = 4e-3,
        sample_rate: float = 10240.0,
        sensors: Sequence[Sensor] | None = None,
        seed: int = 0,
        oversampling: int = 2,
        block_length: int = 8192,
    ) -> None:
        _require_taps(directions, taps, spacing, peak, width)
        chosen = hammer_sensors() if sensors is None else tuple(sensors)
        duration = len(directions) * taps * spacing
        super().__init__(structure, duration, sample_rate, chosen, seed, oversampling, block_length)
        self.directions = tuple(directions)
        self.taps, self.spacing, self.peak, self.width = taps, float(spacing), float(peak), float(width)
        self.title = f"simulated hammer test, {taps} taps at {', '.join(directions)}"
        self.setup = setup_text(
            {
                "test": {"kind": "simulated hammer", "seed": self.seed, "duration_s": duration},
                "hammer": {
                    "directions": " ".join(directions),
                    "taps_per_direction": taps,
                    "spacing_s": self.spacing,
                    "first_tap_s": LEAD,
                },
            }
        )

    def _start(self) -> March:
        return _HammerMarch(self)

    def _rehearse(self) -> tuple[March, int]:
        return _HammerMarch(self), self.n_samples


class _HammerMarch:
    """Force of all taps, and the structure's answer."""

    def __init__(self, cell: HammerCell) -> None:
        generator = np.random.default_rng([cell.seed, 0])
        n_taps = len(cell.directions) * cell.taps
        jitter = generator.uniform(0, 1 / cell.sample_rate, n_taps)
        self._times = LEAD + cell.spacing * np.arange(n_taps) + jitter
        self._peaks = cell.peak * np.clip(generator.normal(1, 0.15, n_taps), 0.3, 1.7)
        self._columns = [TOOL_TIP.index(direction) for direction in cell.directions for _ in range(cell.taps)]
        self._width, self._step = cell.width, cell.step
        self._modes = discretise(cell.structure, cell.step).modes
        self._modal = np.zeros(2 * len(cell.structure.poles))
        self._last_force = np.zeros(3)
        self._done = 0

    def advance(self, n_instants: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Next instants: modal history and force."""
        times = np.arange(self._done, self._done + n_instants) * self._step
        force = np.zeros((n_instants, 3))
        for start, peak, column in zip(self._times, self._peaks, self._columns, strict=True):
            low, high = np.searchsorted(times, [start, start + self._width])
            force[low:high, column] += peak * np.sin(math.pi * (times[low:high] - start) / self._width)
        history = np.empty((n_instants, len(self._modal)))
        respond(force, self._modes, self._last_force, self._modal, history)
        self._done += n_instants
        return history, force


def _require_taps(directions: Sequence[str], taps: int, spacing: float, peak: float, width: float) -> None:
    unknown = [direction for direction in directions if direction not in TOOL_TIP]
    if unknown or not directions:
        raise InputError(f"taps at {', '.join(unknown) or 'nowhere'}; give one or more of {', '.join(TOOL_TIP)}")
    if not (isinstance(taps, int) and taps >= 1):
        raise InputError(f"{taps!r} taps per direction; give a whole number, 1 or more")
    for name, value, unit in (("spacing", spacing, "s"), ("peak", peak, "N"), ("width", width, "s")):
        if not (math.isfinite(value) and value > 0):
            raise InputError(f"{name} of the taps = {value!r} {unit} must be positive and finite")
    if spacing <= LEAD + width:
        raise InputError(f"taps {spacing:g} s apart leave no time to ring down; take several seconds")
