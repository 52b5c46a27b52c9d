"""A `Cause`: physics that is added to a model, at a place and with its numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from ..joints import JointAxis, JointLaw, JointMotion
from ..physics import JointPhysics, LimitedPhysics, Physics

Real = NDArray[np.float64]

ASIDE = 0.02
"""Step of a cause's coordinate for a difference quotient."""

BEYOND_LIMIT = 1e-4
"""Share by which a number may lie beyond its limit: enough to tell that it asks for more, and near the way back."""

LONGEST_STEP = 15.0
"""Largest change of a cause's coordinate in one step of a fit; one on a linear scale may also change by its half."""


@dataclass(frozen=True)
class Cause:
    """One cause at a place with its numbers.

    Parameters
    ----------
    physics
        The kind of cause, from the library.
    values : (n_parameters,)
        Numbers of the cause in SI units, in the order of ``physics.parameters``.
    place
        Place at which a linear cause sits; empty for a joint.
    axis
        Where a joint gives way; None for a linear cause.
    motion
        Sizes of the joint's motion in the trials; None for a linear cause.
    seen
        Deflection and velocity at each sample by recording's name: the law is then driven by them instead of being
        simulated freely. For approaching a solution only; what was measured leaks into the prediction.
    """

    physics: Physics
    values: Real
    place: str = ""
    axis: JointAxis | None = None
    motion: JointMotion | None = None
    seen: Mapping[str, tuple[Real, Real]] | None = None

    @property
    def size(self) -> int:
        """Numbers that are fitted: parameters, and angles of the axis."""
        return len(self.values) + (len(self.axis.entries) - 1 if self.axis is not None else 0)

    def coordinates(self) -> Real:
        """Coordinates that the fit starts from, (size,); angles are zero."""
        values = [p.to_fit(float(v)) for p, v in zip(self.physics.parameters, self.values, strict=True)]
        return np.array(values + [0.0] * (self.size - len(values)))

    def longest_steps(self) -> Real:
        """How far each coordinate may move in one step of a fit, (size,)."""
        numbers = zip(self.coordinates(), self.physics.parameters, strict=False)
        own = [max(LONGEST_STEP, 0.0 if p.logarithmic else 0.5 * abs(float(c))) for c, p in numbers]
        return np.array(own + [LONGEST_STEP] * (self.size - len(own)))

    def moved(self, coordinates: Real) -> "Cause":
        """The cause at other coordinates; angles turn the axis from where it was."""
        count = len(self.values)
        values = np.array(
            [p.from_fit(float(c)) for p, c in zip(self.physics.parameters, coordinates[:count], strict=True)]
        )
        axis = None if self.axis is None else self.axis.turned(coordinates[count:])
        return replace(self, values=values, axis=axis)

    def stepped(self, coordinates: Real) -> "Cause":
        """The cause at other coordinates, where a step leads: hardly beyond the limits within which numbers count."""
        there = self.moved(coordinates)
        held = held_values(there)
        margin = BEYOND_LIMIT * np.abs(held)
        return replace(there, values=np.clip(there.values, held - margin, held + margin))

    def blocked(self) -> Real:
        """Direction of each coordinate, (size,), in which a limit lies: 1 upwards, -1 downwards, 0 where none does."""
        result, here = np.zeros(self.size), self.coordinates()
        for k, parameter in enumerate(self.physics.parameters):
            for side in (-1.0, 1.0):
                aside = here[k] + side * ASIDE
                value = parameter.from_fit(float(aside))
                if isinstance(self.physics, LimitedPhysics):
                    values = self.values.copy()
                    values[k] = value
                    value = float(held_values(replace(self, values=values))[k])
                if abs(parameter.to_fit(value) - aside) > 0.1 * ASIDE:
                    result[k] = side
        return result

    def steps_aside(self) -> Real:
        """Steps of the coordinates, (size,), for difference quotients: away from a limit that is near."""
        return np.where(self.blocked() > 0, -ASIDE, ASIDE)

    def law(self) -> JointLaw:
        """Force law of a joint."""
        assert isinstance(self.physics, JointPhysics)
        assert self.motion is not None
        return self.physics.law(self.values, self.motion)


def location_of(axis: JointAxis, model: ModalModel) -> dict[str, Any]:
    """Location of a joint, as a diagnosis states it; the largest entry is positive.

    Parameters
    ----------
    axis
        Where the joint gives way.
    model
        Model in which it does, whose modes name what takes part.
    """
    if axis.scales is None:
        entries = axis.entries * np.sign(axis.entries[np.argmax(np.abs(axis.entries))])
        return {"direction": [round(float(x), 6) for x in entries]}
    parts = axis.parts(len(model.poles))
    largest = parts[np.argmax(np.abs(parts))]
    # the phase that all modes share is that of the whole, and says nothing
    parts = parts * np.sign(largest.real if largest.real else 1.0)
    frequencies = [round(float(frequency), 4) for frequency in model.natural_frequencies]
    told: list[dict[str, float]] = []
    for frequency, part in zip(frequencies, parts, strict=True):
        sign = -1.0 if part.real < 0 else 1.0
        one = {"mode_hz": frequency, "part": round(sign * float(abs(part)), 6)}
        if len(axis.entries) > len(parts):
            one["lead_deg"] = round(float(np.degrees(np.angle(sign * part))), 2)
        told.append(one)
    return {"participation": told}


def held_values(cause: Cause) -> Real:
    """The numbers that a law goes by, brought within what its name means."""
    if isinstance(cause.physics, LimitedPhysics) and cause.motion is not None:
        return cause.physics.held(cause.values, cause.motion)
    return cause.values
