"""Steps: how one public function becomes a command, a TOML table and a page of the reference.

The signature and the numpydoc docstring of a step are the only place where its options stand: name, type, bounds,
default, unit and meaning. Everything else is read from there by :func:`describe`.
"""

import inspect
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, reduce, wraps
from operator import or_
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, ParamSpec, TypeVar, cast, get_args, get_origin, get_type_hints

from annotated_types import Ge, Gt, Le, Lt

from .argument_types import checked_arguments
from .bands import checked_band
from .described_tables import paragraphs_in, parameters_in
from .errors import InputError
from .whole_files import refuse_busy, refuse_replacing

P = ParamSpec("P")
R = TypeVar("R")


@dataclass(frozen=True)
class Typed:
    """Marker that states how a value is typed on the command line.

    Parameters
    ----------
    metavar
        Placeholder in the help, such as ``LO HI``.
    kind
        Type that the words are converted to; None: that of the annotation.
    """

    metavar: str
    kind: Any = None


@dataclass(frozen=True)
class Reads(Typed):
    """A file that a step reads; Python also takes what an earlier step returned."""

    metavar: str = "FILE"
    kind: Any = Path


@dataclass(frozen=True)
class Writes(Typed):
    """A file or folder that a step writes.

    Parameters
    ----------
    suffixes
        Suffixes that the step writes; empty: a folder.
    needed
        Whether the command line must name it; Python may leave it out, and gets the result alone.
    files
        Names of files that the step always writes into the folder; patterns are allowed.
    """

    metavar: str = "FILE"
    kind: Any = Path
    suffixes: tuple[str, ...] = ()
    needed: bool = False
    files: tuple[str, ...] = ()


@dataclass(frozen=True)
class PythonOnly(Typed):
    """A parameter that only Python passes: no command and no table has it."""

    metavar: str = ""


File = str | os.PathLike[str]
Band = Annotated[tuple[float, float], Typed("LO HI")]
Point = Annotated[tuple[float, float, float], Typed("X Y Z")]
Shares = Annotated[tuple[float, float, float], Typed("F D S")]
Names = Annotated[str | Sequence[str], Typed("NAME", tuple[str, ...])]
Grid = Annotated[tuple[float, float, int], Typed("LO HI N")]


@dataclass(frozen=True)
class Option:
    """One parameter of a step, as its signature and its docstring describe it.

    Parameters
    ----------
    name
        Name of the parameter in Python.
    annotation
        Its type without the markers of this module.
    markers
        Markers and bounds of the annotation.
    default
        Default; ``inspect.Parameter.empty``: it must be given.
    unit, text
        Unit and meaning from the docstring.
    positional, several
        Whether it is typed without a name, and whether it may be given several times.
    """

    name: str
    annotation: Any
    markers: tuple[Any, ...]
    default: Any
    unit: str
    text: str
    positional: bool
    several: bool

    @property
    def marker(self) -> Typed:
        """How it is typed; without a marker, the placeholder of its type."""
        return next((marker for marker in self.markers if isinstance(marker, Typed)), Typed(_metavar(self.annotation)))

    @property
    def kind(self) -> Any:
        """Type that its words on the command line are converted to."""
        return self.annotation if self.marker.kind is None else self.marker.kind

    @property
    def typed(self) -> str:
        """Name as typed: ``--max-depth``; of several names the singular, which may be repeated."""
        name = self.name.removesuffix("s") if self.repeatable and not self.positional else self.name
        return self.marker.metavar if self.positional else "--" + name.replace("_", "-")

    @property
    def repeatable(self) -> bool:
        """Whether it may be named several times."""
        return get_origin(self.kind) is tuple and get_args(self.kind)[-1:] == (...,)

    @property
    def choices(self) -> tuple[str, ...]:
        """Values to choose from; empty: any."""
        return tuple(
            value for part in alternatives(self.annotation) if get_origin(part) is Literal for value in get_args(part)
        )

    @property
    def number_types(self) -> tuple[Any, ...]:
        """Type of each word that it takes on the command line."""
        tuples = [get_args(part) for part in alternatives(self.kind) if get_origin(part) is tuple]
        return tuples[0] if tuples else alternatives(self.kind)

    @property
    def count(self) -> int:
        """Number of words that it takes on the command line; 0 for a flag."""
        if self.kind is bool:
            return 0
        pairs = [get_args(part) for part in alternatives(self.kind) if get_origin(part) is tuple]
        return len(pairs[0]) if pairs and ... not in pairs[0] else 1

    @property
    def is_file(self) -> bool:
        """Whether it names a file or folder."""
        return isinstance(self.marker, Reads | Writes)

    @property
    def public(self) -> bool:
        """Whether commands and tables have it."""
        return not isinstance(self.marker, PythonOnly)

    @property
    def needed(self) -> bool:
        """Whether the command line must name it."""
        return self.default is inspect.Parameter.empty or getattr(self.marker, "needed", False)


def alternatives(annotation: Any) -> tuple[Any, ...]:
    """Return the alternatives of a union type, without None and without markers."""
    if get_origin(annotation) is Annotated:
        return alternatives(get_args(annotation)[0])
    if get_origin(annotation) in (None, tuple, Literal, list) or annotation is NoneType:
        return () if annotation is NoneType else (annotation,)
    return tuple(inner for part in get_args(annotation) for inner in alternatives(part))


def _metavar(annotation: Any) -> str:
    words = {int: "N", float: "NUMBER", str: "TEXT", bool: ""}
    parts = alternatives(annotation)
    if any(get_origin(part) is Literal for part in parts):
        return "|".join(str(value) for part in parts if get_origin(part) is Literal for value in get_args(part))
    return next((words[part] for part in parts if part in words), "FILE")


@dataclass(frozen=True)
class StepText:
    """Description of a step: summary, further paragraphs, options, an example of the command line."""

    summary: str
    paragraphs: tuple[str, ...]
    options: tuple[Option, ...]
    example: str


@cache
def describe(function: Callable[..., Any]) -> StepText:
    """Read a step's description from its signature and docstring.

    Parameters
    ----------
    function
        Public function of a step.

    Raises
    ------
    TypeError
        A parameter that the docstring does not describe.

    Examples
    --------
    >>> def slot(depth: float, /, teeth: int = 2) -> None:
    ...     '''Mill a slot.
    ...
    ...     Parameters
    ...     ----------
    ...     depth : m
    ...         Axial depth of the cut.
    ...     teeth
    ...         Number of teeth.
    ...     '''
    >>> [(option.typed, option.unit, option.text) for option in describe(slot).options]
    [('NUMBER', 'm', 'Axial depth of the cut.'), ('--teeth', '', 'Number of teeth.')]
    """
    text = inspect.getdoc(function) or ""
    described = parameters_in(text)
    hints = get_type_hints(function, include_extras=True)
    options = []
    for name, parameter in inspect.signature(function).parameters.items():
        if name not in described:
            raise TypeError(f"{function.__module__}.{function.__name__}: the docstring does not describe {name}")
        annotation, markers = _unwrapped(hints[name])
        options.append(
            Option(
                name,
                annotation,
                markers,
                parameter.default,
                described[name].unit,
                described[name].text,
                parameter.kind in (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.VAR_POSITIONAL),
                parameter.kind is inspect.Parameter.VAR_POSITIONAL,
            )
        )
    paragraphs = paragraphs_in(text)
    examples = re.findall(r"^\s*\$ (millfrf .*(?:\\\n.*)*)$", text, re.MULTILINE)
    return StepText(
        paragraphs[0],
        paragraphs[1:],
        tuple(options),
        " ".join(examples[0].replace("\\\n", "").split()) if examples else "",
    )


def _unwrapped(annotation: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return the type and the markers of an annotation; for ``Annotated[T, ...] | None``, the markers of T."""
    if get_origin(annotation) is Annotated:
        inner, *markers = get_args(annotation)
        kind, more = _unwrapped(inner)
        return kind, (*more, *markers)
    if not any(get_origin(part) is Annotated for part in get_args(annotation)):
        return annotation, ()
    parts = [_unwrapped(part) for part in get_args(annotation)]
    return reduce(or_, (kind for kind, _ in parts)), tuple(marker for _, markers in parts for marker in markers)


def step(function: Callable[P, R]) -> Callable[P, R]:
    """Make a function a step: check types, choices, bounds and outputs before each call.

    Parameters
    ----------
    function
        Function whose docstring describes each parameter.
    """

    @wraps(function)
    def checked(*args: P.args, **kwargs: P.kwargs) -> R:
        options, signature = describe(function).options, inspect.signature(function)
        bound = checked_arguments(function.__name__, signature, options, args, kwargs)
        check_options(function, bound.arguments)
        check_outputs(function, bound.arguments)
        for path in filter(None, (bound.arguments.get(option.name) for option in outputs_of(function))):
            refuse_busy(Path(path))
        result = function(*bound.args, **bound.kwargs)
        if bound.arguments.get("out") is not None and hasattr(result, "__dict__"):
            # results are frozen; a changed copy has no such entry, as it is not what the file holds
            path = Path(bound.arguments["out"]).resolve()
            vars(result)[WRITTEN] = (path, _state_of(path))
        return result

    return cast(Callable[P, R], checked)


WRITTEN = "written_file"  # entry of a result that holds the file to which a step wrote it, and the file's state


def written_file(result: object) -> Path | None:
    """Return the file to which a step wrote this result; None: it wrote none, or the file was changed since."""
    path, state = getattr(result, "__dict__", {}).get(WRITTEN, (None, None))
    return path if path is not None and _state_of(path) == state else None


def _state_of(path: Path) -> tuple[int, int] | None:
    """Return size and time of the last change of a file; None: there is none."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_size, status.st_mtime_ns


def check_options(function: Callable[..., Any], given: Mapping[str, Any]) -> None:
    """Refuse values outside the choices and bounds of a step's signature."""
    for option in describe(inspect.unwrap(function)).options:
        value = given.get(option.name)
        if value is None or option.several or option.is_file:
            continue
        if option.choices and value not in option.choices:
            raise InputError(f"unknown {option.name} {value!r}; use one of {', '.join(option.choices)}")
        if option.marker.metavar == "LO HI":
            checked_band(value, option.typed)
        for number in value if isinstance(value, tuple | list) else [value]:
            for marker in option.markers:
                _check_bound(option, number, marker)


_BOUNDS: tuple[tuple[type, str, str, Callable[[Any, Any], bool]], ...] = (
    (Gt, "gt", "above", lambda value, bound: value > bound),
    (Ge, "ge", "at least", lambda value, bound: value >= bound),
    (Lt, "lt", "below", lambda value, bound: value < bound),
    (Le, "le", "at most", lambda value, bound: value <= bound),
)


def _check_bound(option: Option, value: Any, marker: Any) -> None:
    for kind, attribute, words, holds in _BOUNDS:
        if isinstance(marker, kind) and not holds(value, getattr(marker, attribute)):
            unit = f" {option.unit}" if option.unit else ""
            bound = getattr(marker, attribute)
            remedy = f"give a number {words} {bound:g}{unit}"
            if not unit and bound == 1 and 1 < value <= 100:
                remedy = f"give a share {words} 1; {value:g} % is {value / 100:g}"
            elif isinstance(option.default, int | float):
                remedy += f"; the default is {option.default:g}"
            raise InputError(f"{option.typed} {value:g}{unit}: {remedy}")


def completed(function: Callable[..., Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return all options of a step except files, with defaults; convert lists to tuples, which JSON cannot store."""
    left_out = Reads | Writes | PythonOnly
    options = [
        option for option in describe(inspect.unwrap(function)).options if not isinstance(option.marker, left_out)
    ]
    values = {option.name: given.get(option.name, option.default) for option in options}
    return {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}


def outputs_of(function: Callable[..., Any]) -> tuple[Option, ...]:
    """Return the parameters that name a file or folder that a step writes."""
    return tuple(option for option in describe(inspect.unwrap(function)).options if isinstance(option.marker, Writes))


def check_outputs(function: Callable[..., Any], given: Mapping[str, Any]) -> None:
    """Refuse outputs that cannot be written, before the computation starts (see :func:`check_output`)."""
    inputs = [Path(value) for value in _inputs(function, given)]
    for option in outputs_of(function):
        if (value := given.get(option.name)) is not None:
            check_output(Path(value), cast(Writes, option.marker).suffixes, inputs, option.typed)
            inputs.append(Path(value))


def _inputs(function: Callable[..., Any], given: Mapping[str, Any]) -> Iterator[File]:
    for option in describe(inspect.unwrap(function)).options:
        if isinstance(option.marker, Reads):
            files = given.get(option.name) if option.several else [given.get(option.name)]
            yield from (file for file in files or () if isinstance(file, str | os.PathLike))


def check_output(path: Path, suffixes: Sequence[str], inputs: Sequence[Path] = (), option: str = "--out") -> None:
    """Refuse an output in a missing folder, with a wrong suffix, or with the name of an input.

    Without suffixes the output is a folder.
    """
    if suffixes and path.suffix.lower() not in suffixes:
        raise InputError(
            f"cannot write {path}: this command writes {' or '.join(suffixes)}; change the suffix of {option}"
        )
    if not path.parent.is_dir():
        raise InputError(f"cannot write {path}: folder {path.parent} does not exist; create it first")
    if suffixes and path.is_dir():
        raise InputError(f"cannot write {path}: it is a folder; give a file name")
    if any(file == path or (file.exists() and path.exists() and path.samefile(file)) for file in inputs):
        raise InputError(f"{path} is the input itself; choose another {option}")


def refuse_outputs(function: Callable[..., Any], given: Mapping[str, Any]) -> None:
    """Refuse to replace existing outputs of a step (see :func:`millfrf.core.keeping_files`)."""
    inputs = {Path(value).resolve() for value in _inputs(function, given)}
    for option in outputs_of(function):
        value, marker = given.get(option.name), cast(Writes, option.marker)
        if value is None:
            continue
        path = Path(value)
        if path.is_dir():
            for pattern in marker.files:
                for present in sorted(path.glob(pattern)):
                    refuse_replacing(present)
        elif marker.suffixes and path.resolve() not in inputs:
            refuse_replacing(path)


def names_of(given: str | Sequence[str]) -> tuple[str, ...]:
    """Split channel names that are given separately or joined with commas.

    Examples
    --------
    >>> names_of(["fx,fy", "fz"]), names_of("ax")
    (('fx', 'fy', 'fz'), ('ax',))
    """
    listed = [given] if isinstance(given, str) else given
    return tuple(name.strip() for text in listed for name in text.split(",") if name.strip())
