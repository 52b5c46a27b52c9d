"""The command line: a command is made from the step behind it; exit code 0 done, 1 the run failed, 2 bad input."""

import inspect
import logging
import os
import re
import sys
import textwrap
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from .commands import STEPS, function_of, summary_of, words_of
from .version import __version__

if TYPE_CHECKING:  # the command line starts without loading a step
    from millfrf.core.steps import Option

DONE, FAILED, BAD_INPUT = 0, 1, 2
STOPPED = "stopped; unfinished files were removed"
REMEDY = "replace it with --force, or choose another name"
ABOUT = "FRFs of machining robots measured while they mill, their modal fit and stability lobes."

COMMON = {
    "force": "Replace files that are there.",
    "quiet": "Print warnings and the answer alone: no progress, no notes.",
    "json": "Print the answer as one JSON document, all else elsewhere.",
    "edited": "Accept files that were edited after this program wrote them; the answer and all outputs say so.",
}
"""Flags of every command; ``--force`` where it writes, ``--edited`` where it reads."""

CONTINUED = ("campaign",)
"""Commands that continue their own earlier outputs, and may therefore write into them."""


def run(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; a failure is one line on standard error.

    Set ``MILLFRF_TRACEBACK=1`` to see where an unexpected failure came from.
    """
    words = words_of(arguments)
    if not words:
        return _without_command(arguments)
    try:
        return _run_step(words, list(arguments)[len(words.split()) :])
    except KeyboardInterrupt as stopped:
        return _fail(str(stopped) or STOPPED, FAILED)
    except Exception as error:
        return _explain(error)


def _without_command(arguments: Sequence[str]) -> int:
    """Version, overview, or an unknown command."""
    if list(arguments[:1]) == ["--version"]:
        _answer(f"millfrf {__version__}")
        return DONE
    if list(arguments[:1]) == ["--install-completion"]:
        return _install_completion()
    group = arguments[0] if arguments and any(words.startswith(f"{arguments[0]} ") for words in STEPS) else ""
    rest = [word for word in arguments[bool(group) :] if word != "--help"]
    if rest:
        typed = f"{group} {rest[0]}".strip()
        return _fail(f"there is no command '{typed}'. Try 'millfrf{f' {group}' if group else ''} --help'.", BAD_INPUT)
    _answer(overview(group))
    return DONE if arguments else BAD_INPUT


def _answer(text: str) -> None:
    """Print an answer that comes without a step."""
    from millfrf.core.terminal import put

    put(text, sys.stdout)


def _install_completion() -> int:
    """Write the script with which the user's shell completes commands and options."""
    from cyclopts import App, Parameter

    app = App(name="millfrf", version_flags=["--version"], default_parameter=Parameter(negative=()))
    groups = {"": app}
    for words in STEPS:
        group, _, name = words.rpartition(" ")
        if group not in groups:
            groups[group] = App(name=group)
            app.command(groups[group])
        groups[group].command(_command(words, function_of(words)), name=name)
    _answer(f"completion installed in {app.install_completion()}; it works in new terminals")
    return DONE


def overview(group: str = "") -> str:
    """List the commands with their summaries; ``group`` is a first word such as ``robot``, empty for all."""
    listed = [words for words in STEPS if not group or words.startswith(f"{group} ")]
    width = max(map(len, listed)) + 2
    lines = [f"Usage: millfrf {group + ' ' if group else ''}COMMAND [OPTIONS]", "", *([ABOUT, ""] if not group else [])]
    lines += ["Commands:", *(f"  {words:{width}}{without_markup(summary_of(words))}" for words in listed)]
    return "\n".join(
        [*lines, "", "'millfrf COMMAND --help' explains a command; 'millfrf --version' names the version."]
    )


def without_markup(text: str) -> str:
    """Text of a docstring without its markup."""
    return re.sub(r":\w+:`~?([^`]*)`|``([^`]*)``|`([^`]*)`", lambda match: next(filter(None, match.groups()), ""), text)


def _run_step(words: str, arguments: list[str]) -> int:
    """Parse the words behind a command, call its step, and print its answer."""
    from cyclopts import CycloptsError

    from millfrf.core import LeftoverRemoved, MillfrfWarning

    from .typed_arguments import with_present_names

    arguments, notes = with_present_names(words, arguments)
    if "--help" in arguments:
        _answer(help_of(words))
        return DONE
    try:
        command, bound = parse(words, arguments)
    except CycloptsError as error:
        return _fail(f"{_message(error)} Try 'millfrf {words} --help'.", BAD_INPUT)
    for note in [] if "--quiet" in arguments else notes:
        print(f"note: {note}", file=sys.stderr)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MillfrfWarning)  # a step prints the warnings of its result itself
        warnings.simplefilter("always", LeftoverRemoved)
        warnings.showwarning = partial(_in_our_words, set())
        with _logged_in_our_words():
            return int(command(*bound.args, **bound.kwargs) or DONE)


def _message(error: Any) -> str:
    """Message of the parser in one line."""
    text = " ".join(str(error).split())
    if text.startswith("Unused Tokens:"):
        unused = ", ".join(re.findall("'([^']*)'", text))
        text = f"{unused}: more than this command takes; give one after the other."
    return text if text.endswith((".", "?")) else f"{text}."


def parse(words: str, arguments: Sequence[str]) -> tuple[Callable[..., int], inspect.BoundArguments]:
    """Parse the words behind a command, and return the function to call with its arguments."""
    from cyclopts import App, Parameter

    from .typed_arguments import check_names, check_numbers, with_lists_apart

    function = function_of(words)
    check_names(words, function, flags_of(words), arguments)
    app = App(name=f"millfrf {words}", help_flags=[], version_flags=[], default_parameter=Parameter(negative=()))
    app.default(_command(words, function))
    typed = with_lists_apart(arguments, function)
    check_numbers(function, typed)
    command, bound, *_ = app.parse_args(typed, exit_on_error=False, print_error=False)
    return command, bound


def help_of(words: str) -> str:
    """Help of a command as text: usage, what it does, arguments and options, an example."""
    from millfrf.core.steps import describe

    described = describe(inspect.unwrap(function_of(words)))
    options = [option for option in described.options if option.public]
    arguments = [option.typed for option in options if option.positional]
    named = [option for option in options if not option.positional]
    needed = [f"{option.typed} {option.marker.metavar}" for option in named if option.needed]
    parts = [f"Usage: millfrf {' '.join([words, *arguments, *needed, '[OPTIONS]'])}"]
    parts += [textwrap.fill(without_markup(text), WIDTH) for text in (described.summary, *described.paragraphs)]
    rows = [(option.typed, help_text(option)) for option in options if option.positional]
    parts += [_listed("Arguments", rows)] if rows else []
    rows = [(f"{option.typed} {option.marker.metavar}".strip(), help_text(option)) for option in named]
    rows += [(f"--{name}", COMMON[name]) for name in flags_of(words)]
    parts += [_listed("Options", rows)]
    parts += [f"Example:\n  {described.example}"] if described.example else []
    return "\n\n".join(parts)


WIDTH = 100


def help_text(option: "Option") -> str:
    """Meaning of an option with its unit and its default, for help and reference."""
    default = default_text(option)
    unit = f" [{option.unit}]" if option.unit else ""
    shown = " [needed]" if option.needed and not option.positional else f" [default: {default}]" if default else ""
    return f"{without_markup(option.text)}{unit}{shown}"


def default_text(option: "Option") -> str:
    """Default of an option as it would be typed; empty where there is none."""
    value = option.default
    if value in (None, False, (), "") or value is inspect.Parameter.empty:
        return ""
    return " ".join(f"{number:g}" for number in value) if isinstance(value, tuple) else str(value)


def flags_of(words: str) -> list[str]:
    """Flags of a command in addition to the options of its step."""
    from millfrf.core.steps import Reads, describe, outputs_of

    function = function_of(words)
    guarded = words == "convert" or (outputs_of(function) and words not in CONTINUED)
    reads = any(isinstance(option.marker, Reads) for option in describe(inspect.unwrap(function)).options)
    left_out = [*([] if guarded else ["force"]), *([] if reads else ["edited"])]
    return [name for name in COMMON if name not in left_out]


def _listed(heading: str, rows: Sequence[tuple[str, str]]) -> str:
    """Names and descriptions in two columns; long names stand on a line of their own."""
    width = min(max(len(name) for name, _ in rows), 28) + 4
    lines = [f"{heading}:"]
    for name, text in rows:
        wrapped = textwrap.wrap(text, WIDTH - width)
        beginning = [f"  {name}"] if len(name) + 3 > width else []
        first = " " * width if beginning else f"  {name}".ljust(width)
        lines += [*beginning, first + wrapped[0], *(" " * width + line for line in wrapped[1:])]
    return "\n".join(lines)


def _command(words: str, function: Callable[..., Any]) -> Callable[..., int]:
    """A step as the parser sees it: typed parameters with help, and the flags that all commands have."""
    from cyclopts import Parameter

    from millfrf.core.steps import describe

    def command(*arguments: Any, **options: Any) -> int:
        common = {name: options.pop(f"common_{name}", False) for name in COMMON}
        return call(words, function, arguments, options, **common)

    parameters = []
    for option in describe(inspect.unwrap(function)).options:
        if not option.public:
            continue
        text = without_markup(option.text) + (f" [{option.unit}]" if option.unit else "")
        shown = option.default not in (None, False, (), "", inspect.Parameter.empty)
        details = Parameter(
            name=None if option.positional else option.typed, help=text, negative=(), show_default=shown
        )
        kind = inspect.Parameter.VAR_POSITIONAL if option.several else inspect.Parameter.POSITIONAL_ONLY
        needed = option.needed and not option.several
        parameters.append(
            inspect.Parameter(
                option.name,
                kind if option.positional else inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if needed or option.several else option.default,
                annotation=Annotated[_taken(option), details],
            )
        )
    for name in flags_of(words):
        details = Parameter(name=f"--{name}", negative=())
        parameters.append(
            inspect.Parameter(
                f"common_{name}", inspect.Parameter.KEYWORD_ONLY, default=False, annotation=Annotated[bool, details]
            )
        )
    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return command


def _taken(option: Any) -> Any:
    """Type that the parser converts words to; None is allowed where it is the default."""
    return option.kind if option.needed or option.default is not None else option.kind | None


def call(
    words: str,
    function: Callable[..., Any],
    arguments: Sequence[Any],
    options: Mapping[str, Any],
    *,
    force: bool = False,
    quiet: bool = False,
    json: bool = False,
    edited: bool = False,
) -> int:
    """Call a step as a command: existing outputs are protected, the answer is printed in words or as JSON."""
    from millfrf.core import accepting_edited, keeping_files, notices_to
    from millfrf.core.content_hashes import EDITED
    from millfrf.core.steps import check_outputs, refuse_outputs
    from millfrf.core.terminal import aside, print_document, speaking, warn

    bound = inspect.signature(function).bind(*arguments, **options).arguments
    guarded = not force and words not in CONTINUED
    accepting: AbstractContextManager[list[str]] = accepting_edited() if edited else nullcontext([])
    with (
        speaking(quiet=quiet, as_json=json) as manner,
        accepting as accepted,
        notices_to(_ignore if quiet else aside),
        keeping_files(REMEDY if guarded else None) as written,
    ):
        if guarded:
            check_outputs(function, bound)
            refuse_outputs(function, bound)
        function(*arguments, **options)
        edits = [f"{name}: {EDITED}" for name in accepted]
        warn([text for text in edits if text not in manner.warnings])
        if json:
            print_document(words, manner, written())
    return manner.exit_code


def _ignore(text: str) -> None:
    del text


def _in_our_words(
    said: set[str], message: object, category: type[Warning], filename: str, line: int, *place: Any
) -> None:
    """Print `LeftoverRemoved` as a note, and what a library warns of, unforeseen by this program, once in one line."""
    del place
    from millfrf.core import LeftoverRemoved
    from millfrf.core.terminal import aside

    if issubclass(category, LeftoverRemoved):
        aside(str(message))
        return
    _say_unforeseen(said, f"{category.__name__}: {message}", f"{Path(filename).name}, line {line}")


def _say_unforeseen(said: set[str], message: str, place: str) -> None:
    from millfrf.core.terminal import manner, printable, warn

    text = (
        f"a library warns of something that this program does not foresee ({' '.join(message.split())}; {place}): look "
        "at the inputs with 'millfrf inspect', and doubt the numbers of this command until the reason is known"
    )
    if text in said:
        return
    said.add(text)
    if manner().silent:  # in a thread, or after the command
        print(f"warning: {printable(text)}", file=sys.stderr)
    else:
        warn([text])


@contextmanager
def _logged_in_our_words() -> Iterator[None]:
    """Print warnings that libraries log, in one line each; without a handler Python prints them as they are."""
    said: set[str] = set()

    class Teller(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            _say_unforeseen(said, record.getMessage(), record.name)

    teller = Teller(logging.WARNING)
    logging.getLogger().addHandler(teller)
    try:
        yield
    finally:
        logging.getLogger().removeHandler(teller)


def _explain(error: Exception) -> int:
    """Print one line for the error that ended a command, and return the exit code."""
    from millfrf.core import InputError, MillfrfError, is_disk_full

    if isinstance(error, InputError):
        return _fail(str(error), BAD_INPUT)
    if isinstance(error, MillfrfError):
        return _fail(str(error), FAILED)
    if os.environ.get("MILLFRF_TRACEBACK"):
        raise error
    if is_disk_full(error):
        return _fail(f"no room for {getattr(error, 'filename', None) or 'temporary files'}; free space first", FAILED)
    if isinstance(error, OSError):
        return _fail(f"{error.filename or 'a file'}: {error.strerror or error}", FAILED)
    return _fail(_unforeseen(error), FAILED)


def _unforeseen(error: Exception) -> str:
    """Describe a fault of the program: where it stopped, without the messages of libraries."""
    if isinstance(error, MemoryError):
        return "not enough memory; ask for fewer lines, speeds or samples"
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "site-packages" not in frame.filename]
    place = f"{Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else "an unknown place"
    return (
        f"the program met something that it does not foresee ({place}); look at the inputs with 'millfrf inspect', and "
        "report it with the files if nothing looks wrong; MILLFRF_TRACEBACK=1 shows more"
    )


def _fail(message: str, code: int) -> int:
    from millfrf.core.terminal import printable

    print("millfrf: " + printable(" ".join(message.split())), file=sys.stderr)
    return code
