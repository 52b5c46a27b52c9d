"""What all commands have in common: files that are there stay unless `--force` says otherwise."""

import inspect
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import typer
from typer.models import OptionInfo

from foundation import keeping_files, refuse_replacing

WRITING = ("--out", "--picture", "--table", "--report", "--candidates", "--figures")
"""Options that name a file or folder to write."""

FOLDERS: Mapping[str, tuple[str, ...]] = {
    "diagnose": ("diagnosis.json", "improved_model.json", "report.html"),
    "cut diagnose": ("diagnosis.json", "improved_cut.toml", "report.html"),
    "robot diagnose": ("robot_diagnosis.json", "report.html"),
    "robot path": ("path.csv", "path.png", "compensated.csv"),
}
"""Files that a command always writes into the folder that it is given, by the words of the command."""

OWN_FOLDER = ("campaign",)
"""Commands that go on with what they wrote themselves: nothing of it is lost, and none of it is refused."""

Force = Annotated[bool, typer.Option("--force", help="Replace files that are there.")]


def framed(words: str, function: Callable[..., None]) -> Callable[..., None]:
    """The function of a command with what all commands have in common, for typer.

    A command that writes gets `--force`. Without it a file that is there is refused before anything is computed, and
    at the latest where it would be replaced.

    Parameters
    ----------
    words
        Words of the command, such as ``robot frf``.
    function
        Function with the command's own parameters.
    """
    writing = _writing(function)
    if words in OWN_FOLDER or not (writing or words == "convert"):
        return function
    asks = "force" in inspect.signature(function).parameters

    @wraps(function)
    def command(force: bool = False, **given: Any) -> None:
        with ExitStack() as stack:
            if not force:
                stack.enter_context(keeping_files("replace it with --force, or choose another name"))
                for path in _named(words, writing, given):
                    refuse_replacing(path)
            function(**given, **({"force": force} if asks else {}))

    signature = inspect.signature(function)
    own = [one for name, one in signature.parameters.items() if name != "force"]
    last = inspect.Parameter("force", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Force)
    command.__signature__ = signature.replace(parameters=[*own, last])  # type: ignore[attr-defined]
    command.__annotations__ = {**function.__annotations__, "force": Force}
    return command


def _writing(function: Callable[..., None]) -> tuple[str, ...]:
    """Names of the parameters that are typed as an option that names something to write."""
    hints = get_type_hints(function, include_extras=True)
    return tuple(name for name, hint in hints.items() if set(option_names(hint)) & set(WRITING))


def option_names(hint: Any) -> tuple[str, ...]:
    """How an option is typed, from the annotation of its parameter; nothing for an argument."""
    for info in get_args(hint)[1:]:
        if isinstance(info, OptionInfo):
            declared = (info.default, *(info.param_decls or ()))
            return tuple(one for one in declared if isinstance(one, str) and one.startswith("-"))
    return ()


def _named(words: str, writing: tuple[str, ...], given: Mapping[str, Any]) -> Iterator[Path]:
    """Files that the command will write, as far as its options tell; an input is left to the command to refuse."""
    inputs = [path for name, value in given.items() if name not in writing for path in _paths(value, texts=True)]
    for name in writing:
        for path in _paths(given.get(name)):
            if path.is_dir():
                yield from (path / file for file in FOLDERS.get(words, ()))
            elif not any(one.exists() and path.exists() and path.samefile(one) for one in inputs):
                yield path


def _paths(value: Any, *, texts: bool = False) -> list[Path]:
    """Paths among what an option was given; ``texts``: also what was typed as text, such as the name of a robot."""
    several: list[Any] = list(value) if isinstance(value, list | tuple) else [value]
    return [Path(one) for one in several if isinstance(one, Path) or (texts and isinstance(one, str))]
