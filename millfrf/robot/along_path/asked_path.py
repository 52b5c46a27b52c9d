"""`AskedPath`: options of `millfrf robot path` as they were typed, and as checked numbers."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError
from millfrf.robot_model import CutPath, Redundancy, RotaryTable

from ..asked_loads import check_degrees, check_places, check_positive
from .certified_search import Wanted
from .objectives import OBJECTIVES


@dataclass(frozen=True)
class AskedPath:
    """Options of the optimisation.

    Parameters
    ----------
    objective, balance
        ``depth``, ``deviation`` or ``both``; share of depth where both count.
    turns
        Range and number of the turns about the tool, degrees.
    table
        Range and number of the turns of a rotary table, degrees; None: there is none.
    table_at, table_about
        A point (m) and the direction of the table's axis; None: the path's first point and its mean direction.
    joint_step, table_step
        Largest step of a joint (degrees; prismatic joints: m, as radians) and of the table between two points.
    limit_margin
        Least distance to a joint limit, degrees.
    singularity_margin
        Least singular value of the tool Jacobian (m, rad).
    """

    objective: str = "depth"
    balance: float = 0.5
    turns: tuple[float, float, int] = (-180.0, 165.0, 24)
    table: tuple[float, float, int] | None = None
    table_at: tuple[float, float, float] | None = None
    table_about: tuple[float, float, float] | None = None
    joint_step: float = 15.0
    table_step: float = 10.0
    limit_margin: float = 5.0
    singularity_margin: float = 0.05

    def check(self) -> None:
        """Refuse what makes no sense.

        Raises
        ------
        InputError
            With the option, the value and the remedy.
        """
        if self.objective not in OBJECTIVES:
            raise InputError(f"--optimise {self.objective!r} is none of {', '.join(OBJECTIVES)}")
        if not 0 <= self.balance <= 1:
            raise InputError(f"--balance {self.balance:g}: give the share of depth, from 0 to 1")
        for name, axis in (("turns", self.turns), ("table", self.table)):
            if axis is not None and not (axis[0] <= axis[1] and 1 <= axis[2] <= 360 and axis[1] - axis[0] <= 720):
                raise InputError(
                    f"--{name} {axis[0]:g} {axis[1]:g} {axis[2]}: give LO HI N in degrees, LO <= HI, N 1 to 360"
                )
            if axis is not None:
                check_degrees(**{name: axis[0]})
        self._check_bounds()

    def _check_bounds(self) -> None:
        check_positive("joint-step", self.joint_step, "degrees", 180)
        check_positive("table-step", self.table_step, "degrees", 180)
        if not 0 <= self.limit_margin <= 90:
            raise InputError(f"--limit-margin {self.limit_margin:g}: give degrees, from 0 to 90")
        if not 0 <= self.singularity_margin <= 1:
            raise InputError(f"--singularity-margin {self.singularity_margin:g}: give a singular value, from 0 to 1")
        if self.table is None and (self.table_at is not None or self.table_about is not None):
            raise InputError(
                "--table-at and --table-about say where a rotary table is: give its range too, --table-turns LO HI N"
            )
        if self.table_at is not None:
            for value in self.table_at:
                check_places(**{"table-at": value})

    def redundancy(self, path: CutPath) -> Redundancy:
        """Sampled angles, zero among them where it lies in the range, and the margins."""
        tool, rotary, table = _sampled(self.turns), None, np.zeros(1)
        if self.table is not None:
            at = path.positions[0] if self.table_at is None else np.array(self.table_at)
            along = path.positions[-1] - path.positions[0]
            if self.table_about is None and np.linalg.norm(along) < 1e-6:
                raise InputError(
                    "the path ends where it begins: say about which direction the table turns, --table-about"
                )
            rotary = RotaryTable(at, along if self.table_about is None else np.array(self.table_about))
            table = _sampled(self.table)
        return Redundancy(tool, table, rotary, np.radians(self.limit_margin), self.singularity_margin)

    def wanted(self) -> Wanted:
        """What is optimised, in rad."""
        return Wanted(self.objective, self.balance, np.radians(self.joint_step), np.radians(self.table_step))


def _sampled(axis: tuple[float, float, int]) -> np.ndarray:
    return np.radians(np.linspace(*axis))
