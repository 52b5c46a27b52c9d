"""What all commands have in common: `--force`, `--quiet`, `--json`, and one place that takes care of them."""

import inspect
from collections.abc import Callable, Iterator, Mapping
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_args, get_type_hints

import typer
from typer.models import OptionInfo

from millfrf.core import keeping_files, notices_to, refuse_replacing
from millfrf.core.terminal import aside, print_document, speaking

WRITING = ("--out", "--picture", "--table", "--report", "--candidates", "--figures", "--pdf", "--pick")
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

ANSWERING = (
    "plan",
    "recover",
    "inspect",
    "convert",
    "estimate",
    "tap",
    "fit",
    "calibrate",
    "lobes",
    "chatter",
    "predict",
    "diagnose",
    "campaign",
    "cut diagnose",
    "robot list",
    "robot modes",
    "robot frf",
    "robot stiffness",
    "robot deviation",
    "robot lobes",
    "robot diagnose",
    "robot update",
)
"""Commands whose answer a script would read."""

REMEDY = "replace it with --force, or choose another name"

Force = Annotated[bool, typer.Option("--force", help="Replace files that are there.")]
Quiet = Annotated[bool, typer.Option("--quiet", help="Print warnings and the answer alone: no progress, no notes.")]
Json = Annotated[bool, typer.Option("--json", help="Print the answer as one JSON document, all else elsewhere.")]


def framed(words: str, function: Callable[..., None]) -> Callable[..., None]:
    """The function of a command with what all commands have in common, for typer.

    A command that writes gets `--force`. Without it a file that is there is refused before anything is computed, and
    at the latest where it would be replaced. Every command gets `--quiet`, and those that answer `--json`.

    Parameters
    ----------
    words
        Words of the command, such as ``robot frf``.
    function
        Function with the command's own parameters.
    """
    writing = _writing(function)
    common: dict[str, Any] = {"quiet": Quiet}
    if (writing or words == "convert") and words not in OWN_FOLDER:
        common = {"force": Force, **common}
    if words in ANSWERING:
        common["as_json"] = Json
    asks = "force" in inspect.signature(function).parameters

    @wraps(function)
    def command(force: bool = False, quiet: bool = False, as_json: bool = False, **given: Any) -> None:
        ended: typer.Exit | None = None
        remedy = REMEDY if "force" in common and not force else None
        with (
            speaking(quiet=quiet, as_json=as_json) as chosen,
            notices_to(_unheard if quiet else aside),
            keeping_files(remedy) as written,
        ):
            for path in _named(words, writing, given):
                refuse_replacing(path)
            try:
                function(**given, **({"force": force} if asks else {}))
            except typer.Exit as exit_with_code:
                ended = exit_with_code
            if as_json:
                print_document(words, chosen, written())
        if ended is not None:
            raise ended

    return _with_options(command, function, common)


def _unheard(text: str) -> None:
    """Let a quiet command tell nothing."""
    del text


def _with_options(
    command: Callable[..., None], function: Callable[..., None], common: Mapping[str, Any]
) -> Callable[..., None]:
    """Let typer see the parameters of a function, and the common ones behind them."""
    signature = inspect.signature(function)
    own = [one for name, one in signature.parameters.items() if name not in common]
    added = [
        inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=False, annotation=kind)
        for name, kind in common.items()
    ]
    command.__signature__ = signature.replace(parameters=[*own, *added])  # type: ignore[attr-defined]
    command.__annotations__ = {**function.__annotations__, **common}
    return command


def _writing(function: Callable[..., None]) -> dict[str, bool]:
    """Parameters that are typed as an option that names something to write, and whether that is a folder alone."""
    hints = get_type_hints(function, include_extras=True)
    return {
        name: any(isinstance(info, OptionInfo) and info.metavar == "DIR" for info in get_args(hint)[1:])
        for name, hint in hints.items()
        if set(option_names(hint)) & set(WRITING)
    }


def option_names(hint: Any) -> tuple[str, ...]:
    """How an option is typed, from the annotation of its parameter; nothing for an argument."""
    for info in get_args(hint)[1:]:
        if isinstance(info, OptionInfo):
            declared = (info.default, *(info.param_decls or ()))
            return tuple(one for one in declared if isinstance(one, str) and one.startswith("-"))
    return ()


def _named(words: str, writing: Mapping[str, bool], given: Mapping[str, Any]) -> Iterator[Path]:
    """Files that the command will write, as far as its options tell.

    An input, and a file where a folder shall be, are left to the command to refuse: `--force` is no remedy there.
    """
    inputs = [path for name, value in given.items() if name not in writing for path in _paths(value, texts=True)]
    for name, folder_alone in writing.items():
        for path in _paths(given.get(name)):
            if path.is_dir():
                files = ("figure_*",) if name == "figures" else FOLDERS.get(words, ())
                yield from (found for file in files for found in sorted(path.glob(file)))
            elif not folder_alone and not any(one.exists() and path.exists() and path.samefile(one) for one in inputs):
                yield path


def _paths(value: Any, *, texts: bool = False) -> list[Path]:
    """Paths among what an option was given; ``texts``: also what was typed as text, such as the name of a robot."""
    several: list[Any] = list(value) if isinstance(value, list | tuple) else [value]
    return [Path(one) for one in several if isinstance(one, Path) or (texts and isinstance(one, str))]
