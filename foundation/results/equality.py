"""Equality of values that hold arrays: ``==`` on arrays gives an array, and NaN differs from itself."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np


def same_values(one: Any, other: Any) -> bool:
    """Whether two values are equal: arrays by shape and every element, dataclasses by every field, NaN equal to NaN.

    Partial functions are equal if they call the same function with equal arguments, and objects without attributes if
    they are of one class; Python compares both by identity, so that a pickle would not come back equal.

    Parameters
    ----------
    one, other
        Numbers, texts, arrays, and dataclasses, sequences or mappings of them.

    Examples
    --------
    >>> import numpy as np
    >>> same_values((1.0, np.array([1.0, np.nan])), (1.0, np.array([1.0, np.nan])))
    True
    >>> same_values(np.zeros(2), np.zeros((1, 2)))
    False
    """
    import numpy as np  # not above: this package is loaded before anything heavy, so that `--help` is quick

    if one is other:
        return True
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return isinstance(one, np.ndarray) and isinstance(other, np.ndarray) and _same_arrays(one, other)
    if type(one) is not type(other):
        return bool(one == other) and not isinstance(one, str | bytes)
    if is_dataclass(one) and not isinstance(one, type):
        compared = [field.name for field in fields(one) if field.compare]
        return all(same_values(getattr(one, name), getattr(other, name)) for name in compared)
    if isinstance(one, partial):
        return same_values((one.func, one.args, one.keywords), (other.func, other.args, other.keywords))
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(same_values(value, other[key]) for key, value in one.items())
    if isinstance(one, Sequence) and not isinstance(one, str | bytes):
        return len(one) == len(other) and all(same_values(*pair) for pair in zip(one, other, strict=True))
    return bool(one == other) or (one != one and other != other) or _stateless(one)


def _stateless(one: Any) -> bool:
    """Whether an object is nothing but an instance of its class: no function, no attributes, no equality of its own."""
    own = any("__eq__" in vars(kind) for kind in type(one).__mro__[:-1])
    plain = not own and not callable(one) and type(one).__module__ != "builtins"
    return plain and getattr(one, "__dict__", None) == {}


def _same_arrays(one: "np.ndarray[Any, Any]", other: "np.ndarray[Any, Any]") -> bool:
    import numpy as np

    numbers = one.dtype.kind in "fc" and other.dtype.kind in "fc"
    return bool(np.array_equal(one, other, equal_nan=numbers))
