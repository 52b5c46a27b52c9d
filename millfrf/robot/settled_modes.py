"""Fewer modes for lobes where high ones would cost minutes a speed and change nothing."""

import numpy as np
from numpy.typing import NDArray

from millfrf.cutting import MillingProcess
from millfrf.stability import certified_lobes, with_static_high_modes
from modal_fit import ModalModel

Real = NDArray[np.float64]

MOST_TURNS = 20.0
"""Turns of the highest mode in the longest tooth period that are computed without asking for fewer."""

SETTLED = 5e-3
"""Relative change of the limits that counts as none."""

_COUNTS = (8, 11, 15, 20, 27, 36, 48)


def settled_modes(
    model: ModalModel, process: MillingProcess, speeds: Real, max_depth: float
) -> tuple[ModalModel, tuple[str, ...]]:
    """Leave high modes as their static flexibility where three speeds show that this changes no limit by 0.5 %.

    A model whose modes turn at most 20 times in the longest tooth period comes back as it is. Else the limits at the
    slowest, a middle and the fastest speed are computed with all modes up to 20 turns, and the fewest are taken that
    give the same; the warning says how many, and by how much limits moved.

    Parameters
    ----------
    model
        Modal model over TCP X, Y, Z.
    process
        Cutter and engagement.
    speeds : (n_speeds,), rad/s
        Spindle speeds of the lobes.
    max_depth : m
        Largest depth that is searched.
    """
    natural = np.sort(model.natural_frequencies)
    most = MOST_TURNS * process.teeth * float(speeds.min()) / (2 * np.pi)
    if natural[-1] <= most or not process.is_plain:
        return model, ()
    steps = [float(natural[count - 1]) * 1.0001 for count in _COUNTS if count < len(natural)]
    steps = [step for step in steps if step <= most] + [max(most, steps[0] if steps else 0.0)]
    checked = np.unique([speeds.min(), speeds[len(speeds) // 2], speeds.max()])
    truth = _limits(with_static_high_modes(model, steps[-1]), process, checked, max_depth)
    for step in steps:
        small = with_static_high_modes(model, step)
        change = float(np.abs(_limits(small, process, checked, max_depth) / truth - 1).max())
        if change < SETTLED:
            break
    words = (
        f"{len(model.poles) - len(small.poles)} modes above {step:.0f} Hz are left as their static flexibility: at "
        f"{len(checked)} speeds, limits with modes up to {steps[-1]:.0f} Hz differ by at most {100 * change:.2g} %"
    )
    return small, (words,)


def _limits(model: ModalModel, process: MillingProcess, speeds: Real, max_depth: float) -> Real:
    found = certified_lobes(model, process, speeds, max_depth).depth_limits
    return np.maximum(np.minimum(np.nan_to_num(found, nan=0.0, posinf=max_depth), max_depth), 1e-9)
