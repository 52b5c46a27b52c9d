"""Equality of values that hold arrays: ``==`` on arrays gives an array, and NaN differs from itself."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np


def same_values(one: Any, other: Any) -> bool:
    """Whether two values are equal: arrays by shape and every element, dataclasses by every field, NaN equal to NaN.

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
    if isinstance(one, Mapping):
        return one.keys() == other.keys() and all(same_values(value, other[key]) for key, value in one.items())
    if isinstance(one, Sequence) and not isinstance(one, str | bytes):
        return len(one) == len(other) and all(same_values(*pair) for pair in zip(one, other, strict=True))
    return bool(one == other) or (one != one and other != other)


def _same_arrays(one: "np.ndarray[Any, Any]", other: "np.ndarray[Any, Any]") -> bool:
    import numpy as np

    numbers = one.dtype.kind in "fc" and other.dtype.kind in "fc"
    return bool(np.array_equal(one, other, equal_nan=numbers))
