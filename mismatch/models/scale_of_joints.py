"""The scale of a joint inside: its deflection is counted in the motion of the tip, as no channel shows its own."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from ..joints import JointAxis, JointMotion, ModalScales, tip_axes
from .cause import Cause
from .hypothesis import Hypothesis

Real = NDArray[np.float64]

FIXED = "force_at_1mm_n"
"""A force that a law tells at a fixed deflection."""


def counted_at_tip(hypothesis: Hypothesis) -> Hypothesis:
    """A hypothesis whose joints inside have the scale at which they move most like the tip; it predicts the same.

    ``x' = x / a`` with ``g' = a g`` is the same joint. With x' regressed on the motion y of the tip,

        x'(t) = d . y(t) + rest, the factor a makes |d| = 1

    so that a joint at the tip, told as one inside, has the numbers that it has at the tip.

    Parameters
    ----------
    hypothesis
        A fitted hypothesis.
    """
    causes = tuple(_counted(cause, hypothesis.model) for cause in hypothesis.causes)
    return replace(hypothesis, causes=causes)


def _counted(cause: Cause, model: ModalModel) -> Cause:
    """A cause in the scale of the tip; as it is where it is no joint inside."""
    if cause.axis is None or cause.axis.scales is None or cause.motion is None or cause.seen is not None:
        return cause
    scale = scale_at_tip(cause.axis, model)
    return cause if scale == 0 or not np.isfinite(scale) else scaled(cause, scale)


def scale_at_tip(axis: JointAxis, model: ModalModel) -> float:
    """Length of the vector d that comes nearest to ``x = d . y`` under broad forces; 0 where there is no tip.

    Parameters
    ----------
    axis
        Axis of a joint over the parts of the modes.
    model
        Modal model in which it gives way.
    """
    rows = tip_axes(model)[0]
    if axis.scales is None or not rows.size:
        return 0.0
    # root mean square of each modal coordinate under forces of one level at all lines
    sizes = np.linalg.norm(model.left, axis=1) / np.sqrt(-model.poles.real)
    deflection = sizes * (axis.entries * axis.scales.seen).reshape(-1, len(sizes)).sum(axis=0)
    tip = sizes[:, None] * (model.right @ rows)
    both = np.vstack([tip.real, tip.imag]), np.concatenate([deflection.real, deflection.imag])
    return float(np.linalg.norm(np.linalg.lstsq(*both, rcond=None)[0]))


def scaled(cause: Cause, factor: float) -> Cause:
    """The same joint with a deflection that is smaller by a factor, and a force that is larger by it.

    Parameters
    ----------
    cause
        A joint's law with its numbers, over the parts of the modes.
    factor
        What the deflection is divided by.
    """
    axis, motion = cause.axis, cause.motion
    assert axis is not None
    assert axis.scales is not None
    assert motion is not None
    scales = ModalScales(axis.scales.seen / factor, axis.scales.pushed / factor)
    moved = JointMotion(
        motion.deflection / factor,
        motion.velocity / factor,
        motion.reach / factor,
        motion.speed / factor,
        motion.stiffness * factor**2,
    )
    powers = np.array([power_of_scale(one.unit) for one in cause.physics.parameters])
    values = cause.values * factor**powers
    names = [one.name for one in cause.physics.parameters]
    if FIXED in names:
        # a force that is told at a fixed deflection goes by the power of the law, too
        values[names.index(FIXED)] *= factor ** cause.values[names.index("exponent")]
    return replace(cause, axis=replace(axis, scales=scales), motion=moved, values=values)


def power_of_scale(unit: str) -> int:
    """Power of the factor in a number of a unit: forces grow with it, and lengths shrink.

    Examples
    --------
    >>> [power_of_scale(unit) for unit in ("N", "m", "N/m", "N s/m", "N s^2/m^2", "m/s", "")]
    [1, -1, 2, 2, 3, -1, 0]
    """
    above, _, below = unit.partition("/")
    power = 0
    for words, sign in ((above, 1), (below, -1)):
        for word in words.split():
            name, _, exponent = word.partition("^")
            power += sign * {"N": 1, "m": -1}.get(name, 0) * int(exponent or 1)
    return power
