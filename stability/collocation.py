"""Stability limits of a modal model with coefficients as they vary, by spectral collocation."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from estimation import Frf
from foundation import InputError
from modal_fit import ModalModel

from .circle_crossings import circle_crossings
from .delay_system import DelaySystem, delay_system
from .stability_limits import StabilityLimits
from .stability_lobes import StabilityLobes
from .zero_order import checked_speeds

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]


def collocation(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Lowest unstable depth at each speed; Hopf and period doubling.

    Parameters
    ----------
    structure
        Modal model at the tool tip.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
    max_depth
        Depths above it are not looked for, m.

    Raises
    ------
    InputError
        As :func:`collocation_limits`.
    """
    return collocation_limits(structure, process, spindle_speeds, max_depth).lowest()


def collocation_limits(
    structure: Frf | ModalModel,
    process: MillingProcess,
    spindle_speeds: Real,
    max_depth: float,
    *,
    threads: int = 1,
    lowest_only: bool = False,
) -> StabilityLimits:
    """All depths at which a Floquet multiplier crosses the unit circle, with frequency, kind and error.

    Each tooth period is collocated on pieces between entries and exits (Butcher et al. 2009; Insperger & Stepan 2011),
    and 1 / depth is found as an eigenvalue of the loop gain on the unit circle, so no grid of depths is needed. With a
    purely regenerative force there is no fold: at a multiplier of 1 the chip would be ``y - y_tau = 0``.

    Parameters
    ----------
    structure, process, spindle_speeds, max_depth
        As :func:`collocation`.
    threads
        Over which the speeds are spread.
    lowest_only
        Do not look above the lowest limit at each speed; a few times faster. Islands below it are still seen.

    Raises
    ------
    InputError
        Speeds or depth not positive, an FRF (fit it, or take ``multi_frequency``), or a structure that cannot be used.
    """
    if isinstance(structure, Frf):
        raise InputError("collocation needs a modal model, this is an FRF; fit it first, or use multi-frequency")
    speeds = checked_speeds(spindle_speeds, max_depth)
    system = delay_system(structure, process)
    chunks = _chunks(speeds)
    with ThreadPoolExecutor(max(1, threads)) as pool:
        parts = list(pool.map(lambda chunk: _limits_of(system, speeds, chunk, max_depth, lowest_only), chunks))
    speed, depth, frequency, at_pi, change, error = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.lexsort([depth, speed])
    kinds = tuple("period-doubling" if doubling else "hopf" for doubling in at_pi[order])
    return StabilityLimits(
        speeds,
        float(max_depth),
        speed[order],
        depth[order],
        frequency[order],
        kinds,
        change[order],
        error[order],
        "collocation",
        system.warnings,
    )


def _chunks(speeds: Real) -> list[Index]:
    """Indices of speeds whose tooth periods differ by less than two fifths: they share their nodes."""
    order = np.argsort(speeds)
    octave = np.floor(np.log(speeds[order] / speeds[order][0]) / np.log(1.4)).astype(int)
    groups = np.split(order, np.flatnonzero(np.diff(octave)) + 1)
    return [part for group in groups for part in np.array_split(group, max(1, len(group) // 32))]


def _limits_of(
    system: DelaySystem, speeds: Real, chunk: Index, max_depth: float, lowest: bool
) -> tuple[Index, Real, Real, NDArray[np.bool_], Index, Real]:
    periods = 2 * np.pi / (system.process.teeth * speeds[chunk])
    found, frequency, error = circle_crossings(system, periods, max_depth, lowest=lowest)
    at_pi = found.theta == np.pi
    change = np.where(found.outward, 1, -1) * np.where(at_pi, 1, 2)
    return chunk[found.speed], found.depth, frequency, at_pi, change, error
