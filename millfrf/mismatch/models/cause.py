"""`Cause`: a kind of cause at a place, with its numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from estimation import BandRecording
from millfrf.core import Real
from modal_fit import ModalModel

from ..joints.joint_axis import JointAxis
from ..joints.joint_law import JointLaw, JointMotion, LawSlopes, law_quotient, law_slopes
from ..physics.protocol import JointPhysics, LimitedPhysics, Parameter, Physics
from ..physics.wider_forms import FreeForm

COORDINATE_STEP = 0.02  # step of a cause's coordinate for a difference quotient

# share by which a number may exceed its limit: the excess shows that the data require a number beyond the limit
BEYOND_LIMIT = 1e-4

# largest change of a coordinate in one step of a fit; a number on a linear scale may also change by half its value
MAX_STEP = 15.0

# factor on the force of a joint in one recording
PRELOAD = Parameter("factor", "", 0.1, 1e-3, 1e3, logarithmic=True)


@dataclass(frozen=True)
class Cause:
    """A cause at a place, with its numbers."""

    physics: Physics  # the kind of cause, from the library
    values: Real  # numbers of the cause in SI units, in the order of ``physics.parameters``, (n_parameters,)
    place: str = ""  # place of a linear cause; empty for a joint
    axis: JointAxis | None = None  # axis of a joint; None for a linear cause
    motion: JointMotion | None = None  # size of the motion of the joint in the recordings; None for a linear cause
    # deflection and velocity at each sample, by recording name, that drive the law; None: it is simulated freely.
    # Such a motion is estimated from the measurement and only used to start a fit
    seen: Mapping[str, tuple[Real, Real]] | None = None
    # factor on the force of a joint in each recording, by name, where its preload differs between recordings; that of
    # the first is 1. Other recordings have the geometric mean of the factors
    preloads: Mapping[str, float] = field(default_factory=dict)

    @property
    def law_size(self) -> int:
        """Number of fitted numbers of the law: parameters, and factors on the force in all recordings but the first."""
        return len(self.values) + max(len(self.preloads) - 1, 0)

    @property
    def mean_preload(self) -> float:
        """Geometric mean of the factors on the force; 1 without factors."""
        return float(np.exp(np.mean(np.log(list(self.preloads.values()) or [1.0]))))

    @property
    def size(self) -> int:
        """Number of fitted numbers: those of the law, and angles of the axis."""
        return self.law_size + (len(self.axis.entries) - 1 if self.axis is not None else 0)

    def coordinates(self) -> Real:
        """Return the coordinates of the present numbers, (size,); the angles of the present axis are zero."""
        values = [p.to_fit(float(v)) for p, v in zip(self.physics.parameters, self.values, strict=True)]
        values += [PRELOAD.to_fit(factor) for factor in list(self.preloads.values())[1:]]
        return np.array(values + [0.0] * (self.size - len(values)))

    def longest_steps(self) -> Real:
        """Return the largest change of each coordinate in one step of a fit, (size,)."""
        numbers = zip(self.coordinates(), self.physics.parameters, strict=False)
        own = [max(MAX_STEP, 0.0 if p.logarithmic else 0.5 * abs(float(c))) for c, p in numbers]
        return np.array(own + [MAX_STEP] * (self.size - len(own)))

    def moved(self, coordinates: Real) -> "Cause":
        """Return the cause at other coordinates; angles rotate the present axis."""
        count = len(self.values)
        values = np.array(
            [p.from_fit(float(c)) for p, c in zip(self.physics.parameters, coordinates[:count], strict=True)]
        )
        factors = [1.0, *(PRELOAD.from_fit(float(c)) for c in coordinates[count : self.law_size])]
        axis = None if self.axis is None else self.axis.rotated(coordinates[self.law_size :])
        return replace(self, values=values, axis=axis, preloads=dict(zip(self.preloads, factors, strict=False)))

    def stepped(self, coordinates: Real) -> "Cause":
        """Return the cause at other coordinates, with numbers clipped to slightly beyond their limits."""
        moved = self.moved(coordinates)
        limited = limited_values(moved)
        margin = BEYOND_LIMIT * np.abs(limited)
        return replace(moved, values=np.clip(moved.values, limited - margin, limited + margin))

    def blocked(self) -> Real:
        """Return the direction in which a limit blocks each coordinate, (size,): 1 upwards, -1 downwards, 0 neither."""
        return self._blocked

    @cached_property
    def _blocked(self) -> Real:
        limited = isinstance(self.physics, LimitedPhysics)
        result, coordinates = np.zeros(self.size), self.coordinates()
        for k, parameter in enumerate(self.physics.parameters):
            for side in (-1.0, 1.0):
                coordinate = coordinates[k] + side * COORDINATE_STEP
                value = parameter.from_fit(float(coordinate))
                if limited:
                    values = self.values.copy()
                    values[k] = value
                    value = float(limited_values(replace(self, values=values))[k])
                if abs(parameter.to_fit(value) - coordinate) > 0.1 * COORDINATE_STEP:
                    result[k] = side
        return result

    def difference_steps(self) -> Real:
        """Return steps of the coordinates, (size,), for difference quotients, away from a near limit."""
        return np.where(self.blocked() > 0, -COORDINATE_STEP, COORDINATE_STEP)

    def law(self, recording: BandRecording | None = None) -> JointLaw:
        """Return the force law of a joint in a recording, or its mean over the recordings."""
        law = self._along(recording)._law
        return law.times(self._preload(recording)) if self.preloads else law

    def _preload(self, recording: BandRecording | None) -> float:
        return self.mean_preload if recording is None else self.preloads.get(recording.name, self.mean_preload)

    def _along(self, recording: BandRecording | None) -> "Cause":
        """Return the cause with the line that sweeps in a recording, if its law follows it."""
        if recording is None or recording.swept_line is None or not self._law.ramp:
            return self
        assert self.motion is not None
        line = recording.swept_line
        if line not in self._along_lines:
            self._along_lines[line] = replace(self, motion=replace(self.motion, swept_line=line))
        return self._along_lines[line]

    @cached_property
    def _along_lines(self) -> "dict[tuple[float, float], Cause]":
        """Causes that :meth:`_along` has returned, by the line: their laws are computed once."""
        return {}

    @cached_property
    def _law(self) -> JointLaw:
        assert isinstance(self.physics, JointPhysics)
        assert self.motion is not None
        return self.physics.law(self.values, self.motion)

    def law_slopes(self, recording: BandRecording | None = None) -> LawSlopes:
        """Return the derivative of a joint law in a recording by the coordinates of the law's numbers."""
        along = self._along(recording)
        if not self.preloads:
            return along._law_slopes
        law = self.law(recording)
        factor = self._preload(recording)
        # a factor scales the derivative of the force by a yield through the springs of the law
        changes = [replace(change.times(factor), yields=change.yields) for change in along._law_changes]
        own = replace(law, yields=np.zeros_like(law.yields)).times(PRELOAD.unit_step)
        present = recording.name if recording is not None else ""
        changes += [own.times(float(name == present)) for name in list(self.preloads)[1:]]
        return law_slopes(law, changes)

    @cached_property
    def _law_slopes(self) -> LawSlopes:
        return law_slopes(self._law, self._law_changes)

    @cached_property
    def _law_changes(self) -> list[JointLaw]:
        """Derivatives of the law by the coordinate of each of its parameters."""
        law, coordinates, steps = self._law, self.coordinates(), self.difference_steps()
        linear: tuple[JointLaw, ...] = ()
        if isinstance(self.physics, FreeForm) and self.motion is not None:
            linear = self.physics.law_changes(self.values, self.motion)
        quotients = []
        for k in range(len(self.values) - len(linear)):
            perturbed = coordinates.copy()
            perturbed[k] += steps[k]
            quotients.append(law_quotient(law, self.moved(perturbed)._law, steps[k]))
        return [*quotients, *linear]


def location_of(axis: JointAxis, model: ModalModel) -> dict[str, Any]:
    """Return the location of a joint for a diagnosis, with the sign for which the largest entry is positive."""
    if axis.scales is None:
        entries = axis.entries * np.sign(axis.entries[np.argmax(np.abs(axis.entries))])
        return {"direction": [round(float(x), 6) for x in entries]}
    parts = axis.participations(len(model.poles))
    largest = parts[np.argmax(np.abs(parts))]
    # the common sign of all participations is arbitrary
    parts = parts * np.sign(largest.real if largest.real else 1.0)
    frequencies = [round(float(frequency), 4) for frequency in model.natural_frequencies]
    listed: list[dict[str, float]] = []
    for frequency, part in zip(frequencies, parts, strict=True):
        sign = -1.0 if part.real < 0 else 1.0
        entry = {"mode_hz": frequency, "part": round(sign * float(abs(part)), 6)}
        if len(axis.entries) > len(parts):
            entry["lead_deg"] = round(float(np.degrees(np.angle(sign * part))), 2)
        listed.append(entry)
    return {"participation": listed}


def limited_values(cause: Cause) -> Real:
    """Return the numbers of a law, clipped to the limits within which its name is valid."""
    if isinstance(cause.physics, LimitedPhysics) and cause.motion is not None:
        return cause.physics.limited(cause.values, cause.motion)
    return cause.values
