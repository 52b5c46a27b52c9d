"""Causes as the terms of a modal model file, and back: what `improved_model.json` holds beside its modes."""

from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any, cast

import numpy as np

from foundation import FileFormatError
from modal_fit import ModalModel

from ..inference import LabError
from ..joints import JointMotion, axis_location, axis_of
from ..physics import (
    FREE_FORM,
    ChainPhysics,
    FreeForm,
    JointPhysics,
    ModePhysics,
    Physics,
    Rig,
    in_units,
    library,
    rig_of,
)
from .cause import Cause
from .freed_laws import EVERYTHING
from .hypothesis import Hypothesis
from .model_shape import ModelShape


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
