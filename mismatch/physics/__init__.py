"""The library of causes: one small file each; :func:`library` finds every file that defines ``PHYSICS``."""

import importlib
import pkgutil
from collections.abc import Collection

from .clipping import PHYSICS as CLIPPING
from .free_form import FREE_FORM, FreeForm, families
from .linear_part import WithLinearPart
from .missing_mode import MOST_DAMPED
from .modal_parameters import PHYSICS as MODAL_PARAMETERS
from .protocol import (
    BeliefPhysics,
    Chain,
    ChainPhysics,
    FaultPhysics,
    FormedPhysics,
    JointPhysics,
    LimitedPhysics,
    ModePhysics,
    Parameter,
    Physics,
    TwinPhysics,
    answer_name,
)
from .rig import Rig, in_units, offered, rig_of
from .unmeasured_excitation import PHYSICS as UNMEASURED_EXCITATION

__all__ = [
    "CLIPPING",
    "FREE_FORM",
    "MODAL_PARAMETERS",
    "MOST_DAMPED",
    "UNMEASURED_EXCITATION",
    "BeliefPhysics",
    "Chain",
    "ChainPhysics",
    "FaultPhysics",
    "FormedPhysics",
    "FreeForm",
    "JointPhysics",
    "LimitedPhysics",
    "ModePhysics",
    "Parameter",
    "Physics",
    "Rig",
    "TwinPhysics",
    "WithLinearPart",
    "answer_name",
    "families",
    "form_of",
    "in_units",
    "is_fault",
    "library",
    "offered",
    "rig_of",
]


def library() -> dict[str, Physics]:
    """Return all causes in this folder by name.

    Examples
    --------
    >>> "coulomb_friction" in library()
    True
    """
    found: dict[str, Physics] = {}
    for module in sorted(pkgutil.iter_modules(__path__), key=lambda module: module.name):
        cause = getattr(importlib.import_module(f"{__name__}.{module.name}"), "PHYSICS", None)
        if cause is not None:
            found[cause.name] = cause
    return found


def is_fault(name: str) -> bool:
    """Tell whether a cause of this name is a fault of the recording itself and no part of the structure.

    Parameters
    ----------
    name
        Name of a cause, as a diagnosis reports it.

    Examples
    --------
    >>> is_fault("clipping"), is_fault("hysteresis")
    (True, False)
    """
    return isinstance(library().get(name), FaultPhysics)


def form_of(answer: str, numbers: Collection[str], rig: Rig | None = None) -> Physics | None:
    """Return the cause that is reported under a name and has these numbers; None where the library has none.

    Parameters
    ----------
    answer
        Name under which the cause is reported.
    numbers
        Names of its numbers.
    rig
        Rig in whose units the numbers are named; None: newtons and metres.

    Examples
    --------
    >>> form_of("coulomb_friction", ["friction_n", "presliding_m"]).name
    'presliding_friction'
    >>> form_of("backlash", ["stiffness_loss_n_per_m", "half_gap_m", "sharpness"]).name
    'smooth_backlash'
    """
    forms = [
        physics
        for physics in (in_units(one, rig or Rig()) for one in library().values())
        if answer_name(physics) == answer and {one.name for one in physics.parameters} <= set(numbers)
    ]
    # one form may have all numbers of another, and more
    return max(forms, key=lambda physics: len(physics.parameters), default=None)
