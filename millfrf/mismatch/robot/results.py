"""Results of a robot's diagnosis, and its file."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from millfrf.core import Real
from millfrf.robot_model import Change, SpatialRobot, changed_robot

from ..inference.diagnosis import AcceptedCause, Candidate, Diagnosis
from ..inference.search import Proposal
from .fit import RobotFit
from .held_out import NumberErrors
from .posed import PosedRobot
from .start import FreeFit

Told = AcceptedCause | Candidate


@dataclass(frozen=True)
class CompanionNumber:
    """A number that was fitted with a change's own: where a mass hangs, how the tool gives way along its axis.

    Parameters
    ----------
    name, unit
        Name and unit of the number.
    number, standard_error
        The number, and its error, of which belief is a part.
    spread
        Standard deviation of what is believed of it: an error as wide says that the recordings tell nothing of it.
    """

    name: str
    unit: str
    number: float
    standard_error: float
    spread: float

    @property
    def told(self) -> bool:
        """Whether the recordings, and not belief alone, say where it is."""
        return self.standard_error < 0.5 * self.spread


def number_of(cause: Told) -> float:
    """The number of a change: factor, kg, m/N, m/s² or rad.

    Parameters
    ----------
    cause
        Accepted or weighed cause of a robot's diagnosis.
    """
    return cause.parameters[cause.name]


def standard_error_of(cause: Told) -> float:
    """Standard error of the number of a change, in its unit.

    Parameters
    ----------
    cause
        Accepted or weighed cause of a robot's diagnosis. The error of an accepted cause includes that of its form;
        the error of a candidate is that of its fit alone.
    """
    return cause.standard_errors[cause.name]


def companions_of(cause: Told) -> tuple[CompanionNumber, ...]:
    """Numbers that were fitted with that of a change.

    Parameters
    ----------
    cause
        Accepted or weighed cause of a robot's diagnosis.
    """
    return tuple(
        CompanionNumber(name, one["unit"], cause.parameters[name], cause.standard_errors[name], one["spread"])
        for name, one in cause.location.get("companions", {}).items()
    )


@dataclass(frozen=True)
class RobotDetails:
    """What a robot's diagnosis was made with.

    Parameters
    ----------
    robot
        The robot in the postures of its recordings.
    nominal, final
        Fits of the robot as modelled, and with the accepted changes.
    free
        Modes and noise as the recordings show them.
    """

    robot: PosedRobot
    nominal: RobotFit
    final: RobotFit
    free: FreeFit

    def improved_robot(self) -> tuple[SpatialRobot, Real]:
        """The robot with the accepted changes, and the angle by which each joint stands elsewhere, rad."""
        return changed_robot(self.robot.robot, self.final.changes, rigid_links=self.robot.rigid_links)


RobotDiagnosis = Diagnosis[RobotDetails]
"""What recordings say about a robot's model: what is left is its excess, see :meth:`RobotComparison.excess`."""


def location_of(change: Change) -> dict[str, Any]:
    """Kind and unit of a change, and what is believed of its companions.

    Parameters
    ----------
    change
        Change whose place in the diagnosis is described.
    """
    place: dict[str, Any] = {"kind": change.kind, "unit": change.unit}
    if change.companions:
        place["companions"] = {one.name: {"unit": one.unit, "spread": one.spread} for one in change.companions}
    return place


def candidate_of(proposal: Proposal[RobotFit], stage: str) -> Candidate:
    """A change that was weighed, with its numbers and the errors of its fit alone.

    Parameters
    ----------
    proposal
        The fitted change.
    stage
        Stage to which the change was taken.
    """
    fitted = proposal.fitted
    numbers, errors = _by_name(fitted, fitted.standard_errors, proposal.name)
    return Candidate(proposal.name, proposal.evidence, stage, proposal.location, numbers, errors)


def accepted_cause(proposal: Proposal[RobotFit], final: RobotFit, errors: NumberErrors) -> AcceptedCause:
    """An accepted change with the numbers of the last fit.

    Parameters
    ----------
    proposal
        The change when it was accepted.
    final
        The last fit.
    errors
        Errors of its numbers.
    """
    numbers, together = _by_name(final, errors.together, proposal.name)
    parts = {"fit": errors.fitted, "spread": errors.spread, "form": errors.form}
    of_each = {part: _by_name(final, values, proposal.name)[1] for part, values in parts.items()}
    by_number = {name: {part: of_each[part][name] for part in parts} for name in numbers}
    return AcceptedCause(proposal.name, proposal.location, numbers, together, proposal.evidence, by_number)


def _by_name(fitted: RobotFit, errors: Real, name: str) -> tuple[dict[str, float], dict[str, float]]:
    """Numbers and errors of a change and of its companions, which follow it."""
    first = [one.name for one, _ in fitted.changes].index(name)
    change = fitted.changes[first][0]
    last = first + 1 + (len(change.companions) if isinstance(change, Change) else 0)
    names = [one.name for one, _ in fitted.changes[first:last]]
    numbers = [number for _, number in fitted.changes[first:last]]
    return dict(zip(names, numbers, strict=True)), dict(zip(names, map(float, errors[first:last]), strict=True))


def content_of(robot: PosedRobot) -> Mapping[str, Any]:
    """What the file of a robot's diagnosis says beside the core's: angles in rad.

    Parameters
    ----------
    robot
        The robot in the postures of its recordings.
    """
    error = robot.error
    return {
        "rigid_links": robot.rigid_links,
        "model_error": {"frequency": error.frequency, "damping": error.damping, "shape": error.shape},
        "recordings": [
            {
                "name": one.name,
                "joints_rad": one.q.tolist(),
                "band_hz": [float(one.spectrum.frequencies[0]), float(one.spectrum.frequencies[-1])],
                "responses": list(one.responses),
                "excitations": list(one.excitations),
            }
            for one in robot.recordings
        ],
    }
