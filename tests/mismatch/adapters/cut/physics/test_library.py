"""A cause is one file of the folder."""

import math
from typing import Any

import numpy as np
import pytest

from millfrf.cutting import MillingProcess
from millfrf.mismatch.cut import physics as physics_folder
from millfrf.mismatch.cut.hypothesis import computed_force, view_of
from millfrf.mismatch.cut.motion import SpindleLaw
from millfrf.mismatch.cut.recordings import CutRecording

CUTTER = MillingProcess(3, 0.012, math.radians(70), 6e8, 0.3, 0.1, 0.3, 2.6, 1e-4)
LAW = SpindleLaw(0.5, 0.2, 90.0)

TOY = """
import numpy as np
from millfrf.mismatch import CutPhysics
from millfrf.mismatch import Parameter


class Toy(CutPhysics):
    name = "toy_drag"

    def parameters(self, process):
        return (Parameter("drag_n_per_m", "N/m", 1e3),)

    def force(self, values, tooth):
        return np.array([values[0], 0.0, 0.0])


PHYSICS = Toy()
"""


def test_a_new_cause_is_one_entry_of_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    defined: dict[str, Any] = {}
    exec(TOY, defined)
    monkeypatch.setattr(physics_folder, "CAUSES", (*physics_folder.CAUSES, defined["PHYSICS"]))
    toy = physics_folder.cut_library()["toy_drag"]
    recording = CutRecording("r", 20000.0, np.zeros((20000, 3)), (0, 1, 2), None, LAW, 0.1)
    view = view_of(recording, CUTTER, LAW, 1)
    added = computed_force(CUTTER, 1e-3, view, [(toy, np.array([5e3]))]) - computed_force(CUTTER, 1e-3, view, ())
    assert added[:, 0].max() >= 5.0 - 1e-9
    assert toy.named_numbers(np.array([1.0]), np.eye(1), CUTTER) == ({"drag_n_per_m": 1.0}, {"drag_n_per_m": 1.0})
