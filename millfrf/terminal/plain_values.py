"""Results as values that JSON knows."""

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import PurePath
from typing import Any


def plain(value: Any) -> Any:
    """Lists, dictionaries, texts, numbers and null; what is not finite is null, a complex number ``[re, im]``.

    Parameters
    ----------
    value
        A result: scalar, array, path, dataclass, or collections of them.

    Examples
    --------
    >>> plain({"depth_m": float("nan"), "poles": (1 + 2j,)})
    {'depth_m': None, 'poles': [[1.0, 2.0]]}
    """
    if isinstance(value, Enum):
        return plain(value.value)
    if value is None or isinstance(value, bool | int):
        return value
    if isinstance(value, str | PurePath):
        return str(value)
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, Mapping):
        return {str(key): plain(one) for key, one in value.items()}
    if is_dataclass(value) and not isinstance(value, type):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    listed = getattr(value, "tolist", None)  # arrays and scalars of NumPy, which is not loaded for `--help`
    return plain(listed()) if callable(listed) else [plain(one) for one in value]
