"""Postures of sets and recordings: as commands take them, and as joint values of the campaign's robot."""

import contextlib
import io
from functools import cached_property
from typing import Any

import numpy as np

from millfrf.core import InputError
from millfrf.robot_model import SpatialCase, read_robot

from ...robot import driven_of
from ..configuration import FoundRecording
from ..graph import RecordingSet

POSE = "pose"


class PostureReader:
    """Reads postures by the campaign's robot; without one degrees are turned into radians.

    Parameters
    ----------
    robot
        Name of a robot that ships, or the path of its file; None: none is stated.
    """

    def __init__(self, robot: str | None) -> None:
        self._robot = robot
        self._known: dict[str, tuple[float, ...] | None] = {}

    @cached_property
    def _case(self) -> SpatialCase | None:
        case: Any = None if self._robot is None else read_robot(self._robot)
        return case if isinstance(case, SpatialCase) else None

    def typed(self, one: RecordingSet | FoundRecording) -> str | None:
        """The posture as commands take it: degrees with commas, or a name that the robot's file knows; else None."""
        stated = one.posture_deg if isinstance(one, RecordingSet) else one.labels.posture_deg
        if stated is not None:
            text = ",".join(f"{value:.10g}" for value in stated)
            return text if len(stated) > 1 else f"{text},"
        named = (one.labels if isinstance(one, RecordingSet) else one.labels.values).get(POSE)
        return named if isinstance(named, str) and self._case is not None and self._driven(named) is not None else None

    def driven(self, one: RecordingSet) -> tuple[float, ...] | None:
        """Driven joint values, rad or m; None where the posture is not known or not of this robot."""
        typed = self.typed(one)
        if typed is None:
            return None
        if self._case is None:
            assert one.posture_deg is not None
            return tuple(float(value) for value in np.radians(one.posture_deg))
        return self._driven(typed)

    def _driven(self, text: str) -> tuple[float, ...] | None:
        if text not in self._known:
            try:
                with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
                    assert self._case is not None
                    self._known[text] = tuple(float(value) for value in driven_of(self._case, text))
            except InputError:
                self._known[text] = None
        return self._known[text]
