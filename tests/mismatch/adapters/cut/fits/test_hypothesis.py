"""One set of numbers: what is replaced is replaced alone."""

import numpy as np
from small_cut import stated


def test_other_numbers_of_one_cause_leave_the_others() -> None:
    begun = stated()
    moved = begun.with_values("regenerative_feedback", np.array([0.7]))
    assert moved.values("regenerative_feedback").tolist() == [0.7]
    assert begun.values("regenerative_feedback").tolist() == [0.0]
    for name in ("runout", "process_damping"):
        assert moved.values(name) is begun.values(name)
        assert moved.cause(name) is begun.cause(name)


def test_another_angle_of_one_recording_leaves_the_others() -> None:
    begun = stated(laws=3)
    moved = begun.with_angle(1, 2.5)
    assert [law.angle for law in moved.laws] == [0.4, 2.5, 0.4]
    assert moved.laws[1].speed == begun.laws[1].speed
