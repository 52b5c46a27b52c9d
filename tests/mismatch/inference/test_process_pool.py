"""Tasks in copies of the process give what the same tasks give one after the other, whatever happens to a copy."""

import multiprocessing
import os
import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from millfrf.mismatch import in_processes

HERE = os.getpid()


@pytest.fixture(autouse=True)
def three_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    """On a machine with one core the tasks would run here, and nothing would be tested."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {0, 1, 2})


def _square(k: int) -> int:
    return k * k


def _fails(k: int) -> int:
    raise ValueError(f"task {k} fails")


def _dies_in_a_copy(k: int) -> int:
    if multiprocessing.parent_process() is not None:
        os._exit(1)
    return -k


def _fails_in_a_copy(k: int) -> int:
    if multiprocessing.parent_process() is not None:
        raise RuntimeError("only in a copy")
    return 100 + k


def _exits(k: int) -> int:
    raise SystemExit(k)


KINDS = (_square, _fails, _dies_in_a_copy, _fails_in_a_copy, _exits)


def _outcome(run: Callable[[], list[int]]) -> object:
    try:
        return run()
    except (ValueError, SystemExit) as error:
        return type(error), str(error)


@pytest.mark.long
@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.sampled_from(KINDS), max_size=8))
def test_any_list_of_tasks_gives_what_a_loop_gives(kinds: list[Callable[[int], int]]) -> None:
    """The results in their order, or the exception of the first task that fails."""
    tasks = [partial(kind, k) for k, kind in enumerate(kinds)]
    assert _outcome(lambda: in_processes(tasks)) == _outcome(lambda: [task() for task in tasks])


def test_results_come_in_the_order_of_the_tasks() -> None:
    """The first task is the slowest."""

    def slow(k: int) -> tuple[int, int]:
        time.sleep(0.05 * (3 - k))
        return k, os.getpid()

    result = in_processes([partial(slow, k) for k in range(3)])
    assert [k for k, _ in result] == [0, 1, 2]


def test_tasks_run_at_the_same_time_in_other_processes() -> None:
    """Each waits for the other: one after the other, the first would wait in vain."""
    first, second = multiprocessing.Event(), multiprocessing.Event()

    def meets(mine: Any, other: Any) -> tuple[bool, int]:
        mine.set()
        return other.wait(20.0), os.getpid()

    (met, each), (met_too, other) = in_processes([partial(meets, first, second), partial(meets, second, first)])
    assert met
    assert met_too
    assert len({each, other, HERE}) == 3


def test_no_more_copies_are_made_than_there_are_tasks_or_cores() -> None:
    def who() -> int:
        time.sleep(0.05)
        return os.getpid()

    assert in_processes([who]) == [HERE]
    assert len(set(in_processes([who] * 8))) <= 3


def test_arrays_come_back_bit_for_bit() -> None:
    drawn = [np.random.default_rng(k).standard_normal((200, 300)) for k in range(4)]
    result = in_processes([partial(np.linalg.svd, each, compute_uv=False) for each in drawn])
    for each, singular_values in zip(drawn, result, strict=True):
        np.testing.assert_array_equal(singular_values, np.linalg.svd(each, compute_uv=False))


def test_of_two_failing_tasks_the_first_is_told() -> None:
    """The second fails at once, the first a while later."""

    def fails_late() -> int:
        time.sleep(0.1)
        raise KeyError("the first task")

    with pytest.raises(KeyError, match="the first task"):
        in_processes([fails_late, partial(_fails, 1)])


def test_tasks_may_be_closures_over_what_cannot_be_pickled() -> None:
    held = (value for value in range(3))
    assert in_processes([lambda: type(held).__name__, lambda: "other"]) == ["generator", "other"]


def test_a_result_that_cannot_be_handed_back_is_made_here() -> None:
    made = in_processes([lambda: (k for k in range(2)), lambda: (k for k in range(3))])
    assert [list(each) for each in made] == [[0, 1], [0, 1, 2]]


class Unreadable:
    """It is pickled, and cannot be unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _fails, (0,)


def test_a_result_that_cannot_be_read_back_is_made_here() -> None:
    made = in_processes([Unreadable, partial(_square, 7)])
    assert isinstance(made[0], Unreadable)
    assert made[1] == 49


def _read_slowly(size: int) -> str:
    time.sleep(1.0)
    return f"read {size}"


class ReadSlowly:
    """Its reading keeps the caller busy."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _read_slowly, (3,)


def test_a_copy_that_dies_with_half_a_result_sent_costs_no_result() -> None:
    """The pipe holds 64 kB of 8 MB when the copy dies; the caller reads another result meanwhile."""

    def sends_half() -> bytes:
        if os.getpid() != HERE:
            time.sleep(0.3)
            threading.Timer(0.3, os._exit, (1,)).start()
        return bytes(8_000_000)

    read, half = in_processes([ReadSlowly, sends_half])
    assert read == "read 3"
    assert half == bytes(8_000_000)


def test_tasks_inside_a_task_run_there() -> None:
    """There are no copies of copies."""

    def inner() -> tuple[int, list[int]]:
        return os.getpid(), in_processes([os.getpid, os.getpid])

    for outer, within in in_processes([inner, inner]):
        assert within == [outer, outer]
        assert outer != HERE


def test_no_copy_is_left_behind() -> None:
    before = set(multiprocessing.active_children())
    in_processes([partial(_square, k) for k in range(5)])
    assert set(multiprocessing.active_children()) == before
