"""What results share: equality by value, four lines of text, an HTML table in which every text is escaped."""

import pickle
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from millfrf.core import InputError, Result, Summary, listed, optional_library
from millfrf.core.results import same_values


@dataclass(frozen=True, eq=False, repr=False)
class Pair(Result):
    """A result of a test."""

    values: NDArray[np.float64]
    name: str = "a"
    more: Mapping[str, object] = field(default_factory=dict)

    def _summary(self) -> Summary:
        return Summary(
            f"Pair: {self.name}", ("one", "two", "three", "four"), ("n",), tuple((str(v),) for v in range(30))
        )


def test_equal_by_value_whatever_holds_the_arrays() -> None:
    single = Pair(np.array([1.0, np.nan]), more={"x": [np.zeros(2), (1, "b")]})
    assert single == Pair(np.array([1.0, np.nan]), more={"x": [np.zeros(2), (1, "b")]})
    assert single != replace(single, values=np.array([1.0, 2.0]))
    assert single != replace(single, values=np.array([[1.0, np.nan]]))
    assert single != replace(single, name="b")
    assert single != replace(single, more={"x": [np.ones(2), (1, "b")]})
    assert single != replace(single, more={"y": 1})
    assert pickle.loads(pickle.dumps(single)) == single


def test_another_type_is_not_compared_and_a_result_has_no_hash() -> None:
    @dataclass(frozen=True, eq=False, repr=False)
    class Other(Pair):
        """The same fields."""

    single = Pair(np.zeros(1))
    assert single.__eq__(Other(np.zeros(1))) is NotImplemented
    assert single != "Pair"
    with pytest.raises(TypeError, match="unhashable"):
        hash(single)


def test_values_of_mixed_types() -> None:
    assert same_values(float("nan"), float("nan"))
    assert same_values(1, 1.0)
    assert not same_values(np.zeros(2), [0.0, 0.0])
    assert not same_values((1, 2), (1, 2, 3))
    assert not same_values("a", None)
    assert same_values(np.array(["a", "b"]), np.array(["a", "b"]))


class Law:
    """An object without attributes."""


class Counter:
    """An object with one."""

    def __init__(self, count: int) -> None:
        self.count = count


def test_what_python_compares_by_identity_is_compared_by_value() -> None:
    assert same_values(partial(np.add, np.zeros(2), out=None), partial(np.add, np.zeros(2), out=None))
    assert not same_values(partial(np.add, np.zeros(2)), partial(np.add, np.ones(2)))
    assert not same_values(partial(np.add, 1.0), partial(np.subtract, 1.0))
    assert same_values((Law(), 1.0), (Law(), 1.0))
    assert not same_values(Law(), Counter(0))
    # a function and an object with a state of its own are equal to themselves alone
    assert not same_values(lambda: 1, lambda: 1)
    assert not same_values(object(), object())
    assert not same_values(Counter(1), Counter(1))


def test_four_lines_and_a_table_of_at_most_twenty_rows() -> None:
    single = Pair(np.zeros(1), name="<script>alert(1)</script> & co")
    assert repr(single).count("\n") == 3
    page = single._repr_html_()
    assert "<script>" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; co" in page
    assert page.count("<tr>") == 1 + 20 + 1
    assert "and 10 more" in page
    cells = Summary("x", (), ("n",), (("<b>",),)).html()
    assert ">&lt;b&gt;</td>" in cells


def test_names_are_listed_up_to_a_number() -> None:
    assert listed(["a", "b"]) == "a, b"
    assert listed(list("abcdefgh")) == "a, b, c, d, e, f and 2 more"


def test_a_missing_library_is_named_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(InputError, match=r'^Frf.to_xarray needs xarray: pip install "millfrf\[notebook\]"$'):
        optional_library("xarray", "Frf.to_xarray")
