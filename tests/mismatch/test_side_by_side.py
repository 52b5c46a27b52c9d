"""Tasks in copies of the process: results in order, faults where they can be seen."""

import os
import time
from functools import partial

import pytest

from mismatch.inference.process_pool import in_processes


def test_results_come_in_the_order_of_the_tasks() -> None:
    """The first task is the slowest."""

    def slow(k: int) -> tuple[int, int]:
        time.sleep(0.05 * (3 - k))
        return k, os.getpid()

    found = in_processes([partial(slow, k) for k in range(3)])
    assert [k for k, _ in found] == [0, 1, 2]


def test_tasks_may_be_closures_over_what_cannot_be_pickled() -> None:
    held = (value for value in range(3))
    assert in_processes([lambda: type(held).__name__, lambda: "other"]) == ["generator", "other"]


def test_a_fault_in_a_task_is_raised_here() -> None:
    def fails() -> int:
        raise ValueError("the second task fails")

    with pytest.raises(ValueError, match="the second task fails"):
        in_processes([lambda: 1, fails])


def test_a_copy_that_dies_costs_no_result() -> None:
    """Its task is done by the caller."""
    here = os.getpid()

    def dies_in_a_copy() -> str:
        if os.getpid() != here:
            os._exit(1)
        return "done here"

    assert in_processes([dies_in_a_copy, lambda: "other"]) == ["done here", "other"]


def test_a_result_that_cannot_be_handed_back_is_made_here() -> None:
    made = in_processes([lambda: (k for k in range(2)), lambda: (k for k in range(3))])
    assert [list(one) for one in made] == [[0, 1], [0, 1, 2]]


def test_tasks_inside_a_task_run_there() -> None:
    """No copies of copies."""

    def inner() -> list[int]:
        return in_processes([os.getpid, os.getpid])

    for pids in in_processes([inner, inner]):
        assert len(set(pids)) == 1
