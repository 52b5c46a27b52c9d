"""Causes as terms of a modal model file, freed joint laws, and the scale of internal joints."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any, cast

import numpy as np

from millfrf.core import FileFormatError, Real
from modal_fit import ModalModel

from ..inference.settings import LabError
from ..joints.joint_axis import JointAxis, ModalScales, axis_location, axis_of, tip_axes
from ..joints.joint_law import JointMotion
from ..physics.free_form import FREE_FORM, FreeForm, families
from ..physics.library import Rig, in_units, library, rig_of
from ..physics.protocol import ChainPhysics, JointPhysics, ModePhysics, Physics
from ..physics.wider_forms import WithLinearPart
from .fitting import Fit
from .hypothesis import Cause, Hypothesis, held_values
from .model_shape import ModelShape

EVERYTHING = "xvmt"
"""All families: deflection (x), velocity (v), memory (m), time (t)."""

OF_FAMILY = {"x": "x", "v": "vm", "m": "vm", "t": "t"}
"""Families whose shapes may mend a law of each family: dry friction gives way elastically before it slides."""


def with_linear_part(cause: Cause) -> Cause:
    """A joint's cause with a spring and a damper of zero strength beside its law.

    Parameters
    ----------
    cause
        A law of a joint with its numbers.
    """
    assert cause.motion is not None
    assert isinstance(cause.physics, JointPhysics)
    physics = WithLinearPart(cause.physics, cause.motion)
    return replace(cause, physics=physics, values=np.append(cause.values, [0.0, 0.0]))


def with_free_forms(hypothesis: Hypothesis, kinds: str = "") -> Hypothesis:
    """A hypothesis in which the form of each joint's law is free; its prediction is the same.

    Parameters
    ----------
    hypothesis
        A hypothesis with laws of joints.
    kinds
        Families of the shapes; empty: for each law those that may mend one of its family.
    """
    causes = tuple(one if one.axis is None else _freed(one, kinds) for one in hypothesis.causes)
    return replace(hypothesis, causes=causes)


def _freed(cause: Cause, kinds: str) -> Cause:
    """The law of a cause with shapes of factor zero."""
    assert isinstance(cause.physics, JointPhysics)
    mending = "".join(OF_FAMILY[one] for one in families(cause.law()))
    kinds = "".join(kind for kind in EVERYTHING if kind in (kinds or mending))
    # a protocol's attributes can be set, those of a frozen record cannot
    physics: Any = FreeForm(cause.physics, kinds)
    own = held_values(cause)
    return replace(cause, physics=physics, values=np.concatenate([own, np.zeros(len(physics.parameters) - len(own))]))


def improved_model(hypothesis: Hypothesis, faults: tuple[dict[str, Any], ...] = ()) -> ModalModel:
    """The refitted modes with a term ``{name, location, parameters}`` for each cause.

    Parameters
    ----------
    hypothesis
        The fitted hypothesis that is written as a model.
    faults
        Terms of causes that are no part of the hypothesis: a tone, a limit.
    """
    terms = []
    for cause in hypothesis.causes:
        if isinstance(cause.physics, ModePhysics):
            continue
        names = [parameter.name for parameter in cause.physics.parameters]
        location: dict[str, Any] = {"place": cause.place}
        if cause.axis is not None and cause.motion is not None:
            location = {**axis_location(cause.axis), "motion": asdict(cause.motion)}
        if isinstance(cause.physics, FreeForm):
            location |= {"law": cause.physics.law_of.name, "families": cause.physics.kinds}
        values = {name: float(value) for name, value in zip(names, cause.values, strict=True)}
        terms.append({"name": cause.physics.name, "location": location, "parameters": values})
    return replace(hypothesis.model, physics=(*terms, *faults))


def hypothesis_of(model: ModalModel, causes: dict[str, Physics] | None = None) -> Hypothesis:
    """A hypothesis that predicts what a model file says; terms that are no physics of the structure are left out.

    Raises
    ------
    FileFormatError
        A term of unknown physics, or one that lacks a number.
    """
    rig = rig_of(model) if model.physics else Rig()
    known = causes if causes is not None else {name: in_units(one, rig) for name, one in library().items()}
    found = []
    for term in model.physics:
        name = term.get("name")
        physics = _physics_of(term, known)
        if not isinstance(physics, ChainPhysics | JointPhysics):
            continue
        try:
            values = np.array([float(term["parameters"][parameter.name]) for parameter in physics.parameters])
            location = term["location"]
            axis = axis_of(location)
            if axis is not None:
                found.append(Cause(physics, values, "", axis, JointMotion(**location["motion"])))
            else:
                found.append(Cause(physics, values, str(location["place"])))
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"the model's term {name} is incomplete: {error}; diagnose again") from error
    shape = ModelShape(replace(model, physics=()), LabError())
    return Hypothesis(shape, np.zeros(shape.size), tuple(found))


def _physics_of(term: Mapping[str, Any], known: Mapping[str, Physics]) -> Physics:
    """The cause of a term, or a law of free form."""
    if term.get("name") != FREE_FORM:
        return _known(str(term.get("name")), known)
    place = term.get("location")
    location: Mapping[str, Any] = place if isinstance(place, Mapping) else {}
    physics, kinds = _known(str(location.get("law")), known), str(location.get("families", ""))
    if not isinstance(physics, JointPhysics) or not kinds or set(kinds) - set(EVERYTHING):
        said = f"{FREE_FORM} of {physics.name} and families {kinds!r}"
        raise FileFormatError(f"the model's term {said} is no law; diagnose again")
    # a protocol's attributes can be set, those of a frozen record cannot
    freed: Any = FreeForm(physics, kinds)
    return cast("Physics", freed)


def _known(name: str, known: Mapping[str, Physics]) -> Physics:
    """A cause of the library."""
    if name not in known:
        raise FileFormatError(f"the model has a term of unknown physics {name!r}; known are {', '.join(known)}")
    return known[name]


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
