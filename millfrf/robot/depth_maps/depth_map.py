"""Depth limits of many postures at one spindle speed: the certified boundary of each."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from millfrf.core import TIP, InputError
from millfrf.cutting import MillingProcess
from millfrf.stability import certified_lobes
from modal_fit import ModalModel

Real = NDArray[np.float64]


def depth_limits(models: Sequence[ModalModel], process: MillingProcess, spindle_speed: float, max_depth: float) -> Real:
    """Give the largest stable depth of each model at one speed, m, (n_models,); infinite above ``max_depth``.

    :func:`millfrf.stability.certified_lobes` of each model. Where the limit has a lower bound only, that bound; where
    it is
    not resolved, zero: no depth is proven there.

    Parameters
    ----------
    models
        Modal models of receptances over TCP X, Y, Z in the axes of the cut.
    process
        Cutter and engagement.
    spindle_speed : rad/s
        Spindle speed of the cut.
    max_depth : m
        Largest axial depth that is searched.

    Raises
    ------
    InputError
        Speed or depth not positive, or a model over other degrees of freedom.
    """
    if not (spindle_speed > 0 and max_depth > 0):
        raise InputError(f"spindle speed {spindle_speed!r} rad/s and depth {max_depth!r} m must be positive")
    speed, limits = np.array([spindle_speed]), np.empty(len(models))
    for i, model in enumerate(models):
        if model.responses != TIP or model.excitations != model.responses:
            raise InputError(f"depth limits need a receptance over TCP:+X, +Y, +Z, not over {model.responses}")
        found = certified_lobes(model, process, speed, max_depth)
        limits[i] = 0.0 if found.status[0] == "unresolved" else found.depth_limits[0]
    return limits
