"""The scale of a joint inside: its deflection is counted in the motion of the tip, as no channel shows its own."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from ..joints import JointAxis, JointMotion, ModalScales, tip_axes
from .cause import Cause
from .fitting import Fit
from .hypothesis import Hypothesis

Real = NDArray[np.float64]

ASIDE = 0.05
"""Step of a coordinate for difference quotients."""

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
    """Length of the vector d that comes nearest to ``x = d . y`` under white forces; 0 where there is no tip.

    The modal coordinates q under independent white forces have the covariance (Lyapunov's equation of a diagonal
    system; the conjugate poles p are modes of their own)

        E q_r conj(q_s) = -(L L^H)_rs / (p_r + conj(p_s))

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
    deflection = (axis.entries * axis.scales.seen).reshape(-1, len(model.poles)).sum(axis=0)
    poles = np.concatenate([model.poles, model.poles.conj()])
    left = np.vstack([model.left, model.left.conj()])
    seen = np.column_stack([model.right @ rows, deflection])
    both = np.vstack([seen, seen.conj()])
    covariance = -(left @ left.conj().T) / (poles[:, None] + poles.conj())
    motion = (both.T @ covariance @ both.conj()).real
    return float(np.linalg.norm(np.linalg.lstsq(motion[:-1, :-1], motion[:-1, -1])[0]))


def spread_with_scale(fitted: Fit, place: int) -> Real:
    """Covariance of a cause's numbers in the fit's coordinates, (n_parameters, n_parameters), counted at the tip.

    The parts of the modes and the modes themselves are not known for sure, and the scale a is not either:

        c'_k = c_k + (d c_k / d ln v_k) power_k ln a(theta)

    Parameters
    ----------
    fitted
        A fit whose joints inside are counted at the tip.
    place
        Which of its causes.
    """
    causes = fitted.hypothesis.causes
    cause, first = causes[place], fitted.hypothesis.size - sum(one.size for one in causes[place:])
    own = slice(first, first + len(cause.values))
    if cause.axis is None or cause.axis.scales is None:
        return fitted.covariance[own, own]
    slopes = np.eye(fitted.hypothesis.size)[own]
    rates = [
        1 / one.unit_step if one.logarithmic else float(value) / one.unit_step
        for one, value in zip(cause.physics.parameters, cause.values, strict=True)
    ]
    slopes += np.outer(np.array(rates) * powers_of_scale(cause), _slopes_of_scale(fitted.hypothesis, cause, first))
    return slopes @ fitted.covariance @ slopes.T


def _slopes_of_scale(hypothesis: Hypothesis, cause: Cause, first: int) -> Real:
    """Change of ln a with each number of a hypothesis, whose own numbers begin at ``first``, (size,)."""
    shape, axis, slopes = hypothesis.shape, cause.axis, np.zeros(hypothesis.size)
    assert axis is not None
    if not (scale := scale_at_tip(axis, hypothesis.model)) > 0:
        return slopes  # a joint that does not move with the tip is not counted there
    for number in range(shape.modal_size):
        aside = ASIDE * np.eye(shape.size)[number]
        more, less = (scale_at_tip(axis, shape.model(hypothesis.u + sign * aside)) for sign in (1, -1))
        slopes[number] = (more - less) / (2 * ASIDE)
    begin, angles = first + len(cause.values), len(axis.entries) - 1
    for number in range(angles):
        aside = ASIDE * np.eye(angles)[number]
        more, less = (scale_at_tip(axis.turned(sign * aside), hypothesis.model) for sign in (1, -1))
        slopes[begin + number] = (more - less) / (2 * ASIDE)
    return slopes / scale


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
    values = cause.values * factor ** powers_of_scale(cause)
    return replace(cause, axis=replace(axis, scales=scales), motion=moved, values=values)


def powers_of_scale(cause: Cause) -> Real:
    """Power of the factor in each number of a joint's law, (n_parameters,)."""
    powers = np.array([power_of_scale(one.unit) for one in cause.physics.parameters], dtype=float)
    names = [one.name for one in cause.physics.parameters]
    if FIXED in names:
        # a force that is told at a fixed deflection goes by the power of the law, too
        powers[names.index(FIXED)] += cause.values[names.index("exponent")]
    return powers


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
