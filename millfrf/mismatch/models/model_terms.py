"""Causes as terms of a modal model file, joint laws of free form, and the scale of joints away from the tip."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any, cast

import numpy as np

from millfrf.core import FileFormatError, Real
from modal_fit import ModalModel

from ..inference.settings import LabError
from ..joints.joint_axis import JointAxis, ModalScales, axis_location, axis_of, tip_axes
from ..joints.joint_law import JointMotion
from ..physics.library import Rig, in_units, library, rig_of
from ..physics.linear_causes import MissingMode
from ..physics.protocol import ChainPhysics, JointPhysics, Physics
from ..physics.wider_forms import FREE_FORM, FreeForm, WithLinearPart, families
from .cause import Cause, limited_values
from .fitting import Fit
from .hypothesis import Hypothesis
from .model_shape import ModelShape

ALL_FAMILIES = "xvmt"  # all families: deflection (x), velocity (v), memory (m), time (t)

# families of the shapes that may correct a law of each family; dry friction (v) also needs memory (m), as it deforms
# elastically before it slides
OF_FAMILY = {"x": "x", "v": "vm", "m": "vm", "t": "t"}


def with_linear_part(cause: Cause) -> Cause:
    """Return a joint cause whose law has an additional spring and damper of zero strength."""
    assert cause.motion is not None
    assert isinstance(cause.physics, JointPhysics)
    physics = WithLinearPart(cause.physics, cause.motion)
    return replace(cause, physics=physics, values=np.append(cause.values, [0.0, 0.0]))


def with_free_forms(hypothesis: Hypothesis, kinds: str = "") -> Hypothesis:
    """Return a hypothesis in which the form of each joint law is free; its prediction is unchanged.

    ``kinds``: families of the shapes that are added to each law. If it is empty, each law gets the families that may
    correct its family.
    """
    causes = tuple(cause if cause.axis is None else _freed(cause, kinds) for cause in hypothesis.causes)
    return replace(hypothesis, causes=causes)


def _freed(cause: Cause, kinds: str) -> Cause:
    """Return a cause whose law has additional shapes with the factor zero."""
    assert isinstance(cause.physics, JointPhysics)
    correcting = "".join(OF_FAMILY[family] for family in families(cause.law()))
    kinds = "".join(kind for kind in ALL_FAMILIES if kind in (kinds or correcting))
    # a protocol's attributes can be set, those of a frozen record cannot
    physics: Any = FreeForm(cause.physics, kinds)
    own = limited_values(cause)
    return replace(cause, physics=physics, values=np.concatenate([own, np.zeros(len(physics.parameters) - len(own))]))


def improved_model(hypothesis: Hypothesis, faults: tuple[dict[str, Any], ...] = ()) -> ModalModel:
    """Return the refitted modes with a term ``{name, location, parameters}`` for each cause.

    Parameters
    ----------
    hypothesis
        The fitted hypothesis that is written as a model.
    faults
        Terms of causes that are no part of the hypothesis: a tone, a limit.
    """
    terms = []
    for cause in hypothesis.causes:
        if isinstance(cause.physics, MissingMode):
            continue
        names = [parameter.name for parameter in cause.physics.parameters]
        location: dict[str, Any] = {"place": cause.place}
        if cause.axis is not None and cause.motion is not None:
            location = {**axis_location(cause.axis), "motion": asdict(cause.motion)}
        if cause.preloads:
            location |= {"preloads": dict(cause.preloads)}
        if isinstance(cause.physics, FreeForm):
            location |= {"law": cause.physics.law_of.name, "families": cause.physics.kinds}
        values = {name: float(value) for name, value in zip(names, cause.values, strict=True)}
        terms.append({"name": cause.physics.name, "location": location, "parameters": values})
    return replace(hypothesis.model, physics=(*terms, *faults))


def _motion_of(content: Mapping[str, Any]) -> JointMotion:
    pairs = {name: content.get(name) for name in ("swept_line", "durations")}
    ranges = {name: None if pair is None else (float(pair[0]), float(pair[1])) for name, pair in pairs.items()}
    return JointMotion(**{**content, **ranges})


def hypothesis_of(model: ModalModel) -> Hypothesis:
    """Return the hypothesis that a model file describes; terms that do not belong to the structure are left out.

    Raises `FileFormatError` if the physics of a term is unknown or one of its numbers is missing.
    """
    rig = rig_of(model) if model.physics else Rig()
    known = {name: in_units(physics, rig) for name, physics in library().items()}
    causes = []
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
                motion, factors = _motion_of(location["motion"]), location.get("preloads", {})
                causes.append(Cause(physics, values, "", axis, motion, preloads=factors))
            else:
                causes.append(Cause(physics, values, str(location["place"])))
        except (KeyError, TypeError, ValueError) as error:
            raise FileFormatError(f"the model's term {name} is incomplete: {error}; diagnose again") from error
    shape = ModelShape(replace(model, physics=()), LabError())
    return Hypothesis(shape, np.zeros(shape.size), tuple(causes))


def _physics_of(term: Mapping[str, Any], known: Mapping[str, Physics]) -> Physics:
    """Return the cause of the library, or the law of free form, that a term names."""
    if term.get("name") != FREE_FORM:
        return _known(str(term.get("name")), known)
    place = term.get("location")
    location: Mapping[str, Any] = place if isinstance(place, Mapping) else {}
    physics, kinds = _known(str(location.get("law")), known), str(location.get("families", ""))
    if not isinstance(physics, JointPhysics) or not kinds or set(kinds) - set(ALL_FAMILIES):
        description = f"{FREE_FORM} of {physics.name} and families {kinds!r}"
        raise FileFormatError(f"the model's term {description} is no law; diagnose again")
    # a protocol's attributes can be set, those of a frozen record cannot
    free_form: Any = FreeForm(physics, kinds)
    return cast("Physics", free_form)


def _known(name: str, known: Mapping[str, Physics]) -> Physics:
    """Return a cause of the library."""
    if name not in known:
        raise FileFormatError(f"the model has a term of unknown physics {name!r}; known are {', '.join(known)}")
    return known[name]


OFFSET = 0.05  # step of a coordinate for difference quotients

FORCE_AT_DEFLECTION = "force_at_1mm_n"  # name of the parameter that is the force of a power law at 1 mm


def counted_at_tip(hypothesis: Hypothesis) -> Hypothesis:
    """Return the hypothesis with the deflections of joints away from the tip referred to the tip.

    A joint with the deflection ``x' = x / a`` and the force ``g' = a g`` predicts the same responses for any a. Here a
    is chosen such that the vector d has the length 1 in the regression of x' on the motion y of the tip,

    x'(t) = d . y(t) + residual

    A joint at the tip that is described by participations then keeps its numbers. So does any joint on a rig that is
    not driven by forces (:func:`has_tip_scale`).
    """
    causes = tuple(_counted(cause, hypothesis.model) for cause in hypothesis.causes)
    return replace(hypothesis, causes=causes)


def _counted(cause: Cause, model: ModalModel) -> Cause:
    """Return a joint with its deflection referred to the tip; other causes and joints at the tip are unchanged."""
    if cause.axis is None or cause.motion is None or cause.seen is not None or not has_tip_scale(cause.axis, model):
        return cause
    scale = scale_at_tip(cause.axis, model)
    return cause if scale == 0 or not np.isfinite(scale) else scaled(cause, scale)


def has_tip_scale(axis: JointAxis, model: ModalModel) -> bool:
    """Check whether the deflection of a joint is referred to the motion of the tip.

    It is not where the axis has no scale of its own, and on rigs that are driven by the acceleration of their base, by
    moments or voltages: the angles of several joints, or motions relative to a base, have no common tip.
    """
    return axis.scales is not None and rig_of(model) == Rig()


def scale_at_tip(axis: JointAxis, model: ModalModel) -> float:
    """Return the length of the vector d in the regression ``x = d . y`` of a joint's deflection on the tip's motion.

    The result is 0 if the model has no tip. All forces are assumed independent and white. The modal coordinates q then
    have the covariance (Lyapunov's equation of a diagonal system; p includes the conjugate poles)

    E q_r conj(q_s) = -(L L^H)_rs / (p_r + conj(p_s))
    """
    rows = tip_axes(model)[0]
    if axis.scales is None or not rows.size:
        return 0.0
    deflection = (axis.entries * axis.scales.seen).reshape(-1, len(model.poles)).sum(axis=0)
    poles = np.concatenate([model.poles, model.poles.conj()])
    left = np.vstack([model.left, model.left.conj()])
    outputs = np.column_stack([model.right @ rows, deflection])
    signals = np.vstack([outputs, outputs.conj()])
    covariance = -(left @ left.conj().T) / (poles[:, None] + poles.conj())
    motion = (signals.T @ covariance @ signals.conj()).real
    return float(np.linalg.norm(np.linalg.lstsq(motion[:-1, :-1], motion[:-1, -1])[0]))


def spread_with_scale(fitted: Fit, place: int) -> Real:
    """Return the covariance of the numbers of a joint law if deflections are referred to the tip.

    The shape is (law_size, law_size), in fit coordinates. The scale a depends on the fitted numbers theta and
    is uncertain like these. The coordinate c_k of the number v_k with the power power_k of the scale becomes

    c'_k = c_k + (d c_k / d ln v_k) power_k ln a(theta)
    """
    causes = fitted.hypothesis.causes
    cause, first = causes[place], fitted.hypothesis.size - sum(later.size for later in causes[place:])
    own = slice(first, first + cause.law_size)
    if cause.axis is None or not has_tip_scale(cause.axis, fitted.hypothesis.model):
        return fitted.covariance[own, own]
    slopes = np.eye(fitted.hypothesis.size)[own]
    rates = [
        1 / parameter.unit_step if parameter.logarithmic else float(value) / parameter.unit_step
        for parameter, value in zip(cause.physics.parameters, cause.values, strict=True)
    ]
    count = len(rates)
    slopes[:count] += np.outer(
        np.array(rates) * powers_of_scale(cause), _slopes_of_scale(fitted.hypothesis, cause, first)
    )
    return slopes @ fitted.covariance @ slopes.T


def _slopes_of_scale(hypothesis: Hypothesis, cause: Cause, first: int) -> Real:
    """Return the derivative of the logarithm of the scale a by each fitted number, (size,).

    The numbers of the cause begin at index ``first``.
    """
    shape, axis, slopes = hypothesis.shape, cause.axis, np.zeros(hypothesis.size)
    assert axis is not None
    if not (scale := scale_at_tip(axis, hypothesis.model)) > 0:
        return slopes  # the scale of a joint that does not move with the tip is arbitrary
    for number in range(shape.modal_size):
        offset = OFFSET * np.eye(shape.size)[number]
        above, below = (scale_at_tip(axis, shape.model(hypothesis.u + sign * offset)) for sign in (1, -1))
        slopes[number] = (above - below) / (2 * OFFSET)
    begin, angles = first + cause.law_size, len(axis.entries) - 1
    for number in range(angles):
        offset = OFFSET * np.eye(angles)[number]
        above, below = (scale_at_tip(axis.rotated(sign * offset), hypothesis.model) for sign in (1, -1))
        slopes[begin + number] = (above - below) / (2 * OFFSET)
    return slopes / scale


def scaled(cause: Cause, factor: float) -> Cause:
    """Return the same joint with its deflection divided, and its force multiplied, by a factor."""
    axis, motion = cause.axis, cause.motion
    assert axis is not None
    assert axis.scales is not None
    assert motion is not None
    scales = ModalScales(axis.scales.seen / factor, axis.scales.pushed / factor)
    lengths = {name: getattr(motion, name) / factor for name in ("deflection", "velocity", "reach", "speed")}
    moved = replace(motion, stiffness=motion.stiffness * factor**2, **lengths)
    values = cause.values * factor ** powers_of_scale(cause)
    return replace(cause, axis=replace(axis, scales=scales), motion=moved, values=values)


def powers_of_scale(cause: Cause) -> Real:
    """Return the exponent of the factor of :func:`scaled` in each number of a joint law, (n_parameters,)."""
    powers = np.array([power_of_scale(parameter.unit) for parameter in cause.physics.parameters], dtype=float)
    names = [parameter.name for parameter in cause.physics.parameters]
    if FORCE_AT_DEFLECTION in names:
        # a force at a fixed deflection also changes with the power of the law
        powers[names.index(FORCE_AT_DEFLECTION)] += cause.values[names.index("exponent")]
    return powers


def power_of_scale(unit: str) -> int:
    """Return the exponent of the factor of :func:`scaled` in a number with this unit.

    Forces are multiplied by the factor, and lengths divided.

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
