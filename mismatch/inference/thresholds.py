"""`LabError`, and `Thresholds`, base of the settings: numbers with which no decision can be made are refused."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from numbers import Integral, Real
from typing import Any, ClassVar

from foundation import InputError


@dataclass(frozen=True)
class LabError:
    """One standard deviation of what a laboratory's modal fit is usually off.

    The defaults are choices of this project for a careful laboratory: frequencies agree to a per cent, dampings to some
    ten, shapes to a few. Round robins compare laboratories, and state no such figure (Balmes, GARTEUR group on ground
    vibration testing: results from the test of a single structure by 12 laboratories in Europe, IMAC XV, 1997). They
    set what counts as a deviation, not how well anything is estimated.

    Parameters
    ----------
    frequency, damping
        Relative error of a mode's natural frequency and of its damping ratio.
    shape
        Error of each real and imaginary part of a vector's entries, relative to the vector's root mean square.

    Raises
    ------
    InputError
        An error that is no share above 0 and below 1.
    """

    frequency: float = 0.01
    damping: float = 0.12
    shape: float = 0.03

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < 1:
                raise InputError(f"LabError.{name} = {value!r} must be a share above 0 and below 1; 0.12 is 12 %")


@dataclass(frozen=True)
class Thresholds:
    """Numbers that decide something: none is negative or NaN, counts are whole, and shares lie from 0 to 1.

    A comparison with NaN is always false. Such a threshold would let everything pass, or nothing, in silence.

    Raises
    ------
    InputError
        A field that is no such number; the message names it with its value.

    Examples
    --------
    >>> @dataclass(frozen=True)
    ... class Doubt(Thresholds, shares=["most"]):
    ...     most: float = 0.1
    >>> Doubt(5)
    Traceback (most recent call last):
    foundation.errors.InputError: Doubt.most = 5 must be a share from 0 to 1; 0.05 is 5 %
    """

    shares: ClassVar[frozenset[str]] = frozenset()

    def __init_subclass__(cls, shares: Sequence[str] = ()) -> None:
        cls.shares = cls.shares | set(shares)

    def __post_init__(self) -> None:
        for one in fields(self):
            if one.type in (int, float):
                self._check(one.name, getattr(self, one.name), one.type is int)

    def _check(self, name: str, value: Any, whole: bool) -> None:
        said = f"{type(self).__name__}.{name} = {value!r}"
        if not isinstance(value, Integral if whole else Real) or not float(value) >= 0:
            raise InputError(f"{said} must be a {'whole ' if whole else ''}number that is not negative")
        if name in self.shares and float(value) > 1:
            raise InputError(f"{said} must be a share from 0 to 1; 0.05 is 5 %")
