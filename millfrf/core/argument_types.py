"""Types of arguments: a value is checked against an annotation, and refused in one line that says what to give."""

import difflib
import inspect
import math
import numbers
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Literal, Union, get_args, get_origin

from .errors import InputError
from .terminal import manner
from .units import without_unit

if TYPE_CHECKING:
    from .steps import Option

_LONGEST = 60  # characters of a value in a message


class _UnfitError(Exception):
    """A value that is not of a type."""


def checked_arguments(
    name: str, signature: inspect.Signature, options: Sequence["Option"], args: Sequence[Any], kwargs: Mapping[str, Any]
) -> inspect.BoundArguments:
    """Return the arguments of a call of a step, in the types and units of its options, with defaults.

    Parameters
    ----------
    name, signature, options
        Name, signature and options of the step.
    args, kwargs
        Arguments of the call.

    Raises
    ------
    InputError
        A value of another type, an argument that the step has not, or one that is missing.
    """
    known = [option.name for option in options]
    for unknown in kwargs.keys() - set(known):
        near = difflib.get_close_matches(unknown, known, 1)
        remedy = f"did you mean {near[0]}?" if near else f"it has {', '.join(known)}"
        raise InputError(f"{name} has no argument {unknown!r}; {remedy}")
    try:
        bound = signature.bind_partial(*args, **kwargs)
    except TypeError as error:
        kinds = [parameter.kind for parameter in signature.parameters.values()]
        most = sum(
            kind in (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD) for kind in kinds
        )
        remedy = f"takes {most} without a name, {len(args)} are given" if len(args) > most else str(error)
        raise InputError(f"{name}: {remedy}; give the others by their names: {', '.join(known)}") from error
    for option in options:
        if option.name in bound.arguments:
            bound.arguments[option.name] = _in_type(option, bound.arguments[option.name], name)
        elif option.default is inspect.Parameter.empty and not option.several:
            raise InputError(f"{name} needs {option.name}: {option.text}")
    bound.apply_defaults()
    return bound


def _in_type(option: "Option", value: Any, step_name: str) -> Any:
    """Return a value, or each of several, in the type of its option."""
    if value is option.default:
        return value

    def checked(item: Any) -> Any:
        kind, metavar = option.annotation, option.marker.metavar
        name = option.name if manner().silent else option.typed  # a command line names it as it is typed
        return checked_type(name, item, kind, option.unit, metavar=metavar, is_file=option.is_file)

    if not option.several:
        return checked(value)
    for item in value:
        if isinstance(item, list | tuple):
            raise InputError(f"{option.name} {shown(item)}: give them one by one, {step_name}(*{option.name})")
    return tuple(checked(item) for item in value)


def checked_type(
    name: str, value: Any, annotation: Any, unit: str = "", *, metavar: str = "", is_file: bool = False
) -> Any:
    """Return a value as the type that an annotation states.

    Quantities of pint become numbers in ``unit``, numbers of numpy those of Python, lists tuples, and objects that
    stand for a file the path of it.

    Parameters
    ----------
    name
        Name of the argument, for the message.
    value
        Value that was given.
    annotation
        Type without markers.
    unit
        Unit of its numbers; empty: none.
    metavar
        Placeholder of a tuple, such as ``LO HI``, for the message.
    is_file
        Whether a text is the name of a file, for the message.

    Raises
    ------
    InputError
        A value of another type.

    Examples
    --------
    >>> checked_type("band", [5, 60], tuple[float, float], "Hz")
    (5, 60)
    >>> checked_type("band", [700], tuple[float, float], "Hz", metavar="LO HI")
    Traceback (most recent call last):
    millfrf.core.errors.InputError: band [700]: give 2 numbers LO HI, in Hz
    """
    if value is None and _takes_none(annotation):
        return None
    try:
        plain = without_unit(value, unit)
    except InputError as error:
        raise InputError(f"{name} {error}") from error
    kinds = _kinds(annotation)
    for kind in sorted(kinds, key=_is_path):  # an object that is a path as well is taken as it is where it may be
        try:
            return _as(kind, plain)
        except _UnfitError:
            continue
    words = list(dict.fromkeys(_in_words(kind, unit, metavar, is_file) for kind in kinds))
    expected = " or ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)
    raise InputError(f"{name} {shown(value)}: give {expected}")


def shown(value: Any) -> str:
    """Show a value in a message: in one line, and cut.

    Examples
    --------
    >>> shown([700]), shown("a" * 100)[-6:]
    ('[700]', 'aaa...')
    """
    shape = getattr(value, "shape", None)
    if isinstance(shape, tuple) and shape:
        return f"array of shape {shape}"
    text = " ".join((str(value) if hasattr(value, "magnitude") else repr(value)).split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 3]}..."


def _kinds(annotation: Any) -> tuple[Any, ...]:
    """Return the alternatives of a union type, without None."""
    if get_origin(annotation) not in (Union, UnionType):
        return () if annotation is NoneType else (annotation,)
    return tuple(inner for part in get_args(annotation) for inner in _kinds(part))


def _takes_none(annotation: Any) -> bool:
    return annotation is NoneType or any(_takes_none(part) for part in get_args(annotation) if part is not ...)


def _as(kind: Any, value: Any) -> Any:
    """Return the value as one kind without alternatives; raise `_UnfitError` if it is of another kind."""
    origin, parts = get_origin(kind), get_args(kind)
    if kind in (int, float, bool):
        return _number(kind, value)
    if origin is Literal:
        return _if(isinstance(value, str), value)  # which texts there are is another check
    if origin is tuple:
        return _tuple(parts, value)
    if origin is Sequence:
        return tuple(_as(parts[0], part) for part in _listed(value))
    if _is_path(kind):
        return value if isinstance(_if(isinstance(value, os.PathLike), value), Path) else Path(value)
    return _if(isinstance(value, origin or kind), value)


def _is_path(kind: Any) -> bool:
    return os.PathLike in (kind, get_origin(kind))


def _if(holds: bool, value: Any) -> Any:
    if not holds:
        raise _UnfitError
    return value


def _number(kind: Any, value: Any) -> Any:
    if getattr(value, "shape", None) == ():
        value = value.item()  # numbers of numpy
    is_truth = isinstance(value, bool)
    if kind is bool:
        return _if(is_truth, value)
    wanted = numbers.Integral if kind is int else numbers.Real
    _if(isinstance(value, wanted) and not is_truth, value)
    return _if(not math.isnan(value), value)


def _tuple(parts: Sequence[Any], value: Any) -> tuple[Any, ...]:
    items = _listed(value)
    if ... in parts:
        return tuple(_as(parts[0], item) for item in items)
    _if(len(items) == len(parts), items)
    return tuple(_as(part, item) for part, item in zip(parts, items, strict=True))


def _listed(value: Any) -> list[Any]:
    """Return the items of a list, a tuple or an array of one dimension."""
    if len(getattr(value, "shape", ())) == 1:
        return [item.item() if hasattr(item, "item") else item for item in value]
    return list(_if(isinstance(value, list | tuple), value))


def _in_words(kind: Any, unit: str, metavar: str, is_file: bool) -> str:
    """Return what to give, such as ``a number, in Hz``."""
    origin, parts = get_origin(kind), get_args(kind)
    in_unit = f", in {unit}" if unit else ""
    if kind in (int, float, bool):
        return {int: "a whole number", float: "a number", bool: "True or False"}[kind] + (
            "" if kind is bool else in_unit
        )
    if kind is str or _is_path(kind):
        return "the name of a file" if is_file else "a text"
    if origin is Literal:
        return f"one of {', '.join(map(str, parts))}"
    if origin is tuple and ... not in parts:
        return f"{len(parts)} numbers{f' {metavar}' if metavar else ''}{in_unit}"
    if origin in (tuple, Sequence):
        return "a list of texts" if parts[0] is str else f"a list of numbers{in_unit}"
    if getattr(kind, "_is_protocol", False):
        summary = (inspect.getdoc(kind) or kind.__name__).splitlines()[0].rstrip(".").replace("`", "")
        return f"a {summary[0].lower()}{summary[1:]}"
    name = str((origin or kind).__name__)
    return {"Frf": "an Frf"}.get(name, f"{'an' if name[0] in 'AEIOU' else 'a'} {name}")
