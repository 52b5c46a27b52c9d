"""What a robot's diagnosis says: causes with numbers, verdict, errors on what was left out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_model import SpatialRobot, changed_robot

from .robot_fit import RobotFit
from .robot_search import FreeFit
from .robot_setting import Setting

Real = NDArray[np.float64]

VERDICTS = ("none", "explained", "class", "partly explained", "unexplained")


@dataclass(frozen=True)
class Beside:
    """A number that was fitted with a cause's own: where a mass hangs, how the tool gives way along its axis.

    Parameters
    ----------
    name, unit
        Of the number.
    number, standard_error
        Of which belief is a part: an error as wide as ``spread`` says that the recordings tell nothing of it.
    spread
        Standard deviation of what is believed of it.
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


@dataclass(frozen=True)
class RobotCause:
    """One change, fitted.

    Parameters
    ----------
    name, kind, unit
        Of the change.
    number, standard_error
        Factor, kg, m/N or rad. The error of an accepted cause holds its form: root of the sum of squares of the three
        that follow; of a candidate it is that of its fit.
    evidence
        Gain in score over the robot without it.
    fitted_error, spread, form
        Of the fit, between fits that leave a recording out, and with other changes free beside it
        (:class:`NumberErrors`).
    beside
        Numbers that were fitted with it.
    stage
        Of a candidate with evidence that was not chosen: why.
    """

    name: str
    kind: str
    unit: str
    number: float
    standard_error: float
    evidence: float
    fitted_error: float = 0.0
    spread: float = 0.0
    form: float = 0.0
    beside: tuple[Beside, ...] = ()
    stage: str = ""


@dataclass(frozen=True)
class HeldOut:
    """Error on a recording left out of the fit, relative to its root mean square response.

    Parameters
    ----------
    name
        Of the recording.
    before, after
        Of the robot as modelled and with the changes, no mode allowed to deviate.
    free
        Of modes fitted to it freely: what noise leaves.
    """

    name: str
    before: float
    after: float
    free: float


@dataclass(frozen=True)
class RobotDiagnosis:
    """What the recordings say about the robot's model.

    Parameters
    ----------
    verdict
        ``none``: nothing needs changing; ``explained``: one change stands alone; ``class``: several changes explain
        as well as each other; ``partly explained``: changes take away half or more on recordings held out, and leave
        more than an explanation may; ``unexplained``: something is wrong that no change explains.
    causes
        Accepted, in the order found; none where the verdict is ``unexplained``.
    equivalents
        Names that the recordings cannot tell from the last accepted cause.
    candidates
        All that were weighed in the first round, best first.
    excess_before, excess_after
        What the robot leaves beyond freely fitted modes, for each deviation of a mode that the recordings tell: at
        most 1 where the robot is right.
    held_out
        One for each recording that was left out in turn.
    p_value
        That the changes do not lower the error on what was held out, from blocks of a second; 1 without a change.
    setting, nominal, final, free
        What the diagnosis was made with.
    """

    verdict: str
    causes: tuple[RobotCause, ...]
    equivalents: tuple[str, ...]
    candidates: tuple[RobotCause, ...]
    excess_before: float
    excess_after: float
    held_out: tuple[HeldOut, ...]
    p_value: float
    setting: Setting
    nominal: RobotFit
    final: RobotFit
    free: FreeFit

    def improved_robot(self) -> tuple[SpatialRobot, Real]:
        """The robot with the accepted changes, and by how much its joints stand elsewhere, rad."""
        return changed_robot(self.setting.robot, self.final.changes, rigid_links=self.setting.rigid_links)
