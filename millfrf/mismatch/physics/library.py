"""The library of causes, and the units of a rig in which their parameters are reported."""

import copy
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from estimation import BandRecording, family_of, quantities_of_unit
from millfrf.core import SI_UNITS
from modal_fit import ModalModel

from .joint_laws import (
    BACKLASH,
    COULOMB_FRICTION,
    HYSTERESIS,
    POSE_DRIFT,
    PRESLIDING_FRICTION,
    QUADRATIC_DAMPING,
    SATURATING_HARDENING,
    SMOOTH_BACKLASH,
    SPEED_STIFFNESS,
    STIFFNESS_HARDENING,
    STIFFNESS_SOFTENING,
)
from .linear_causes import (
    AC_COUPLING,
    AXIS_MISALIGNMENT,
    CHANNEL_COUPLING,
    CHANNEL_DELAY,
    CROSS_TALK,
    DYNAMOMETER_AXES,
    DYNAMOMETER_DYNAMICS,
    DYNAMOMETER_TABLE_INERTIA,
    GAIN_ERROR,
    GYROSCOPIC_COUPLING,
    MISSING_MODE,
    MODAL_PARAMETERS,
    NON_PROPORTIONAL_DAMPING,
    TRANSDUCER_RESONANCE,
)
from .protocol import ChainPhysics, FaultPhysics, JointPhysics, Parameter, Physics, axes_of, reported_name
from .recording_faults import (
    CLIPPING,
    CLOCK_SKEW,
    QUANTISATION,
    REVERSED_CHANNEL,
    SWAPPED_CHANNELS,
    UNMEASURED_EXCITATION,
    RecordingFault,
)

SUFFIXES = {"N": "n", "N m": "nm", "V": "v", "m/s^2": "m_per_s2", "m": "m", "rad": "rad"}  # suffix of names by unit


@dataclass(frozen=True)
class Rig:
    """Quantities of a rig."""

    excitation: str = "force"  # quantity that drives the rig: force, moment, voltage, or the acceleration of its base
    # quantity of the motion before it is differentiated: displacement, angle, or another quantity of the model
    deflection: str = "displacement"

    @property
    def force_unit(self) -> str:
        """Unit of the excitation, and of the forces of joints."""
        return SI_UNITS[self.excitation]

    @property
    def deflection_unit(self) -> str:
        """Unit of the deflection."""
        return SI_UNITS[self.deflection]

    def in_units(self, parameter: Parameter) -> Parameter:
        """Return a number of a cause with its name and unit for this rig.

        >>> Rig("moment", "angle").in_units(Parameter("stiffness_n_per_m", "N/m", 1.0)).unit
        'N m/rad'
        >>> Rig("voltage").in_units(Parameter("friction_n", "N", 0.1)).name
        'friction_v'
        """
        if (self.excitation, self.deflection) == ("force", "displacement"):
            return parameter
        force, length = self.force_unit, self.deflection_unit
        f, m = (SUFFIXES.get(unit, unit.lower()) for unit in (force, length))
        force_in_ratio = f"({force})" if "/" in force else force
        endings = {
            "N/m": ("n_per_m", f"{force_in_ratio}/{length}", f"{f}_per_{m}"),
            "N s/m": ("ns_per_m", f"{force_in_ratio} s/{length}", f"{f}_s_per_{m}"),
            "N s^2/m^2": ("ns2_per_m2", f"{force_in_ratio} s^2/{length}^2", f"{f}_s2_per_{m}2"),
            "m/s": ("m_per_s", f"{length}/s", f"{m}_per_s"),
            "kg": ("mass_kg", f"{force_in_ratio} s^2/{length}", f"inertia_{f}_s2_per_{m}"),
            "m": ("m", length, m),
            "N": ("n", force, f),
        }
        if parameter.unit not in endings:
            return parameter
        old, unit, new = endings[parameter.unit]
        name = parameter.name.removesuffix(old) + new
        return replace(parameter, name=name.replace("_at_1mm_", f"_at_1m{m}_"), unit=unit)


def rig_of(model: ModalModel) -> Rig:
    """Return the quantities of the rig that a model describes, from the model's unit.

    Parameters
    ----------
    model
        Modal model whose unit is a response over an excitation.

    Raises
    ------
    InputError
        The unit does not state an excitation and a response.
    """
    response, excitation = quantities_of_unit(model.unit)
    return Rig(excitation, family_of(response)[0])


def offered(
    causes: Mapping[str, Physics], model: ModalModel, recordings: Sequence[BandRecording] = ()
) -> tuple[dict[str, Physics], tuple[str, ...]]:
    """Return the causes that are possible on a rig, in its units, and sentences on the causes that are not.

    A stiffness that follows the spindle speed is possible where the speed shows in the force of each recording.
    ``model`` is the nominal model in deflections (:func:`millfrf.mismatch.records.reading.in_deflections`).
    """
    rig, reasons = rig_of(model), dict[str, list[str]]()
    selected: dict[str, Physics] = {}
    for name, physics in causes.items():
        if physics is SPEED_STIFFNESS and any(recording.swept_line is None for recording in recordings):
            continue
        reason = _impossible_on(rig, physics, model)
        if reason:
            label = reported_name(physics) if not isinstance(physics, JointPhysics) else "laws of joints"
            names = reasons.setdefault(reason, [])
            names += [] if label in names else [label]
        else:
            selected[name] = in_units(physics, rig)
    return selected, tuple(
        f"not considered: {', '.join(names).replace('_', ' ')}; {reason}" for reason, names in reasons.items()
    )


def in_units(physics: Physics, rig: Rig) -> Physics:
    """Return a cause whose numbers have the names and units of a rig; the same object for newtons and metres."""
    parameters = tuple(rig.in_units(parameter) for parameter in physics.parameters)
    if parameters == tuple(physics.parameters):
        return physics
    # the attribute of the class is read-only for users of the protocol
    converted: Any = copy.copy(physics)
    converted.parameters = parameters
    result: Physics = converted
    return result


def _impossible_on(rig: Rig, physics: Physics, model: ModalModel) -> str:
    """Return why a cause is impossible on a rig; an empty text if it is possible."""
    measured: tuple[str, ...] = getattr(physics, "drives", ())
    if measured and rig.excitation not in measured:
        article = {"force": "a", "moment": "a", "voltage": "a", "acceleration": "the"}[rig.excitation]
        base = " of its base" if rig.excitation == "acceleration" else ""
        return f"the rig is driven with {article} {rig.excitation}{base}, not with a measured {measured[0]}"
    if not isinstance(physics, JointPhysics) and not getattr(physics, "acts_on_motion", False):
        return ""
    if not set(axes_of(model.excitations)) & set(axes_of(model.responses)):
        return "no response lies along a driven axis, so that the motion that they act on is not measured"
    if rig.excitation == "acceleration" and moves_with_base(model):
        return (
            "responses contain the motion of the base, and these act on the motion relative to it: subtract the base's "
            "motion from them and fit again"
        )
    if isinstance(physics, ChainPhysics) and rig.excitation == "voltage":
        return "numbers of the structure in volts would have no meaning: measure the force as well"
    return ""


def moves_with_base(model: ModalModel) -> bool:
    """Return whether the displacements of a model driven by a base's acceleration include the motion of the base.

    This motion is ``1 / s^2``, which appears in the model as a lower residual near 1.
    """
    if model.residuals is None:
        return False
    rows, columns = axes_of(model.responses), axes_of(model.excitations)
    lower = [model.residuals.lower[i, j] for i, row in enumerate(rows) for j, col in enumerate(columns) if row == col]
    return bool(lower) and max(lower) > 0.5


# all causes of a structure, in the order in which they are screened; a new cause is added here
CAUSES: tuple[Any, ...] = (
    AC_COUPLING,
    AXIS_MISALIGNMENT,
    BACKLASH,
    CHANNEL_COUPLING,
    CHANNEL_DELAY,
    CLIPPING,
    CLOCK_SKEW,
    COULOMB_FRICTION,
    CROSS_TALK,
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
    QUANTISATION,
    REVERSED_CHANNEL,
    SATURATING_HARDENING,
    SMOOTH_BACKLASH,
    SPEED_STIFFNESS,
    STIFFNESS_HARDENING,
    STIFFNESS_SOFTENING,
    SWAPPED_CHANNELS,
    TRANSDUCER_RESONANCE,
    UNMEASURED_EXCITATION,
)


def library() -> dict[str, Physics]:
    """Return all causes of a structure by name."""
    return {cause.name: cause for cause in CAUSES}


def is_fault(name: str) -> bool:
    """Return whether the cause with this name is a fault of the recording, not a part of the structure."""
    return isinstance(library().get(name), FaultPhysics | RecordingFault)


def form_of(answer: str, numbers: Collection[str], rig: Rig | None = None) -> Physics | None:
    """Return the cause with this reported name and these numbers; None if the library has none.

    Parameters
    ----------
    answer
        Name under which the cause is reported.
    numbers
        Names of its numbers.
    rig
        Rig whose units the names state; None for newtons and metres.

    Examples
    --------
    >>> form_of("coulomb_friction", ["friction_n", "presliding_m"]).name
    'presliding_friction'
    """
    forms = [
        physics
        for physics in (in_units(cause, rig or Rig()) for cause in library().values())
        if reported_name(physics) == answer and {number.name for number in physics.parameters} <= set(numbers)
    ]
    # a form may have all numbers of a simpler form: the form with most parameters is returned
    return max(forms, key=lambda physics: len(physics.parameters), default=None)
