"""The library of causes, and the units of a rig in which their parameters are reported."""

import copy
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

from estimation import family_of, quantities_of_unit
from millfrf.core import SI_UNITS
from modal_fit import ModalModel

from .joint_friction import COULOMB_FRICTION, HYSTERESIS, PRESLIDING_FRICTION, QUADRATIC_DAMPING
from .joint_stiffness import (
    BACKLASH,
    POSE_DRIFT,
    SATURATING_HARDENING,
    SMOOTH_BACKLASH,
    STIFFNESS_HARDENING,
    STIFFNESS_SOFTENING,
)
from .measuring_chain import (
    AC_COUPLING,
    AXIS_MISALIGNMENT,
    CHANNEL_DELAY,
    CLIPPING,
    DYNAMOMETER_AXES,
    DYNAMOMETER_DYNAMICS,
    DYNAMOMETER_TABLE_INERTIA,
    GAIN_ERROR,
    UNMEASURED_EXCITATION,
)
from .protocol import ChainPhysics, FaultPhysics, JointPhysics, Parameter, Physics, answer_name, axes_of
from .structural import GYROSCOPIC_COUPLING, MISSING_MODE, MODAL_PARAMETERS, NON_PROPORTIONAL_DAMPING

SHORT = {"N": "n", "N m": "nm", "V": "v", "m/s^2": "m_per_s2", "m": "m", "rad": "rad"}
"""Units as they stand at the end of a number's name."""


@dataclass(frozen=True)
class Rig:
    """Quantities of a rig.

    Parameters
    ----------
    excitation
        Quantity that drives it: force, moment, voltage, or the acceleration of its base.
    deflection
        Quantity of the motion before it is differentiated: displacement, angle, or what else a model gives.
    """

    excitation: str = "force"
    deflection: str = "displacement"

    @property
    def force_unit(self) -> str:
        """Unit of what drives the rig, and of what joints put against it."""
        return SI_UNITS[self.excitation]

    @property
    def deflection_unit(self) -> str:
        """Unit of the deflection."""
        return SI_UNITS[self.deflection]

    @property
    def responses(self) -> tuple[str, ...]:
        """Quantities in which the motion may be recorded."""
        return family_of(self.deflection)

    def told(self, parameter: Parameter) -> Parameter:
        """A number of a cause, with name and unit in the rig's units.

        Examples
        --------
        >>> Rig("moment", "angle").told(Parameter("stiffness_n_per_m", "N/m", 1.0)).unit
        'N m/rad'
        >>> Rig("voltage").told(Parameter("friction_n", "N", 0.1)).name
        'friction_v'
        """
        if (self.excitation, self.deflection) == ("force", "displacement"):
            return parameter
        force, move = self.force_unit, self.deflection_unit
        f, m = (SHORT.get(unit, unit.lower()) for unit in (force, move))
        brackets = f"({force})" if "/" in force else force
        endings = {
            "N/m": ("n_per_m", f"{brackets}/{move}", f"{f}_per_{m}"),
            "N s/m": ("ns_per_m", f"{brackets} s/{move}", f"{f}_s_per_{m}"),
            "N s^2/m^2": ("ns2_per_m2", f"{brackets} s^2/{move}^2", f"{f}_s2_per_{m}2"),
            "m/s": ("m_per_s", f"{move}/s", f"{m}_per_s"),
            "kg": ("mass_kg", f"{brackets} s^2/{move}", f"inertia_{f}_s2_per_{m}"),
            "m": ("m", move, m),
            "N": ("n", force, f),
        }
        if parameter.unit not in endings:
            return parameter
        old, unit, new = endings[parameter.unit]
        name = parameter.name.removesuffix(old) + new
        return replace(parameter, name=name.replace("_at_1mm_", f"_at_1m{m}_"), unit=unit)


def rig_of(model: ModalModel) -> Rig:
    """The rig whose model this is, by the model's unit.

    Raises
    ------
    InputError
        A unit that does not say what drives the rig and what answers.
    """
    response, excitation = quantities_of_unit(model.unit)
    return Rig(excitation, family_of(response)[0])


def offered(causes: Mapping[str, Physics], model: ModalModel) -> tuple[dict[str, Physics], tuple[str, ...]]:
    """Causes that make sense on a rig, their numbers in its units, and sentences on those that do not.

    Parameters
    ----------
    causes
        Causes by name.
    model
        The nominal model in deflections (:func:`millfrf.mismatch.records.reading.in_deflections`).
    """
    rig, left_out = rig_of(model), dict[str, list[str]]()
    kept: dict[str, Physics] = {}
    for name, physics in causes.items():
        reason = _senseless(physics, rig, model)
        if reason:
            told = answer_name(physics) if not isinstance(physics, JointPhysics) else "laws of joints"
            named = left_out.setdefault(reason, [])
            named += [] if told in named else [told]
        else:
            kept[name] = in_units(physics, rig)
    return kept, tuple(
        f"not asked for: {', '.join(names).replace('_', ' ')}; {reason}" for reason, names in left_out.items()
    )


def in_units(physics: Physics, rig: Rig) -> Physics:
    """A cause whose numbers have names and units of a rig; the same object on a rig of newtons and metres."""
    told = tuple(rig.told(parameter) for parameter in physics.parameters)
    if told == tuple(physics.parameters):
        return physics
    other = copy.copy(physics)
    other.parameters = told
    return other


def _senseless(physics: Physics, rig: Rig, model: ModalModel) -> str:
    """Why a cause makes no sense on a rig; empty where it does."""
    measured: tuple[str, ...] = getattr(physics, "drives", ())
    if measured and rig.excitation not in measured:
        return f"it is driven with {_A[rig.excitation]}, not with a measured {measured[0]}"
    if not isinstance(physics, JointPhysics) and not getattr(physics, "acts_on_motion", False):
        return ""
    if not set(axes_of(model.excitations)) & set(axes_of(model.responses)):
        return "no response lies along an axis that is driven, so the motion that they act on is not seen"
    if rig.excitation == "acceleration" and moves_with_base(model):
        return (
            "responses hold the motion of the base, and these act on the motion relative to it: subtract the base's "
            "from them and fit again"
        )
    if isinstance(physics, ChainPhysics) and rig.excitation == "voltage":
        return "numbers of the structure in volts would say nothing: measure the force as well"
    return ""


_A = {
    "force": "a force",
    "moment": "a moment",
    "voltage": "a voltage",
    "acceleration": "the acceleration of its base",
}


def moves_with_base(model: ModalModel) -> bool:
    """Whether displacements over a base's acceleration hold the base's own ``1 / s^2``: a lower residual near 1."""
    if model.residuals is None:
        return False
    rows, columns = axes_of(model.responses), axes_of(model.excitations)
    lower = [model.residuals.lower[i, j] for i, row in enumerate(rows) for j, col in enumerate(columns) if row == col]
    return bool(lower) and max(lower) > 0.5


CAUSES: tuple[Any, ...] = (
    AC_COUPLING,
    AXIS_MISALIGNMENT,
    BACKLASH,
    CHANNEL_DELAY,
    CLIPPING,
    COULOMB_FRICTION,
    DYNAMOMETER_AXES,
    DYNAMOMETER_DYNAMICS,
    DYNAMOMETER_TABLE_INERTIA,
    GAIN_ERROR,
    GYROSCOPIC_COUPLING,
    HYSTERESIS,
    MISSING_MODE,
    MODAL_PARAMETERS,
    NON_PROPORTIONAL_DAMPING,
    POSE_DRIFT,
    PRESLIDING_FRICTION,
    QUADRATIC_DAMPING,
    SATURATING_HARDENING,
    SMOOTH_BACKLASH,
    STIFFNESS_HARDENING,
    STIFFNESS_SOFTENING,
    UNMEASURED_EXCITATION,
)
"""All causes that a diagnosis weighs, in the order in which they are screened; a new one is added here."""


def library() -> dict[str, Physics]:
    """Return all causes by name.

    Examples
    --------
    >>> "coulomb_friction" in library()
    True
    """
    return {cause.name: cause for cause in CAUSES}


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
