"""The command line: a command is made from the step behind it; exit code 0 done, 1 the run failed, 2 bad input."""

import difflib
import inspect
import os
import re
import sys
import textwrap
import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from .commands import FORMER_NAMES, STEPS, function_of, summary_of, words_of
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
}
"""Flags of every command; ``--force`` where it writes."""

CONTINUED = ("campaign",)
"""Commands that continue what they wrote themselves: nothing of it is lost, and none of it is refused."""


def run(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; a failure is one line on standard error.

    Set ``MILLFRF_TRACEBACK=1`` to see where an unexpected failure came from.
    """
    words = words_of(arguments)
    if not words:
        return _without_command(arguments)
    try:
        return _run_step(words, list(arguments)[len(words.split()) :])
    except KeyboardInterrupt:
        return _fail(STOPPED, FAILED)
    except Exception as error:
        return _explain(error)


def _without_command(arguments: Sequence[str]) -> int:
    """Version, overview, or an unknown command."""
    if list(arguments[:1]) == ["--version"]:
        print(f"millfrf {__version__}")
        return DONE
    group = arguments[0] if arguments and any(words.startswith(f"{arguments[0]} ") for words in STEPS) else ""
    rest = [word for word in arguments[bool(group) :] if word != "--help"]
    if rest:
        typed = f"{group} {rest[0]}".strip()
        return _fail(f"there is no command '{typed}'. Try 'millfrf{f' {group}' if group else ''} --help'.", BAD_INPUT)
    print(overview(group))
    return DONE if arguments else BAD_INPUT


def overview(group: str = "") -> str:
    """Commands with their summaries, as ``millfrf --help`` prints them.

    Parameters
    ----------
    group
        First word of the commands that are listed; empty: all.
    """
    listed = [words for words in STEPS if not group or words.startswith(f"{group} ")]
    width = max(map(len, listed)) + 2
    lines = [f"Usage: millfrf {group + ' ' if group else ''}COMMAND [OPTIONS]", "", *([ABOUT, ""] if not group else [])]
    lines += ["Commands:", *(f"  {words:{width}}{_plain(summary_of(words))}" for words in listed)]
    return "\n".join(
        [*lines, "", "'millfrf COMMAND --help' explains a command; 'millfrf --version' names the version."]
    )


def _plain(text: str) -> str:
    """Text of a docstring without its markup."""
    return re.sub(r":\w+:`~?([^`]*)`|``([^`]*)``|`([^`]*)`", lambda found: next(filter(None, found.groups()), ""), text)


def _run_step(words: str, arguments: list[str]) -> int:
    """Parse the words behind a command, call its step, and print its answer as it is asked for."""
    from cyclopts import CycloptsError

    from millfrf.core import LeftoverRemoved, MillfrfWarning

    arguments, notes = with_present_names(words, arguments)
    if "--help" in arguments:
        print(help_of(words))
        return DONE
    try:
        command, bound = parse(words, arguments)
    except CycloptsError as error:
        return _fail(f"{_said(error)} Try 'millfrf {words} --help'.", BAD_INPUT)
    for note in [] if "--quiet" in arguments else notes:
        print(f"note: {note}", file=sys.stderr)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MillfrfWarning)  # a step prints the warnings of its result itself
        warnings.simplefilter("always", LeftoverRemoved)
        warnings.showwarning = partial(_say_in_one_line, warnings.showwarning)
        return int(command(*bound.args, **bound.kwargs) or DONE)


def _said(error: Any) -> str:
    """Message of the parser in one line."""
    text = " ".join(str(error).split())
    return text if text.endswith((".", "?")) else f"{text}."


def parse(words: str, arguments: Sequence[str]) -> tuple[Callable[..., int], inspect.BoundArguments]:
    """Parse the words behind a command, and give the function to call with its arguments.

    Parameters
    ----------
    words
        Words of the command.
    arguments
        Words behind it.

    Raises
    ------
    cyclopts.CycloptsError
        An option that is unknown, missing, or not of its type.
    """
    from cyclopts import App, Parameter

    function = function_of(words)
    _check_names(words, function, arguments)
    app = App(name=f"millfrf {words}", help_flags=[], version_flags=[], default_parameter=Parameter(negative=()))
    app.default(_command(words, function))
    typed = with_lists_apart(arguments, function)
    _check_whole_numbers(function, typed)
    command, bound, *_ = app.parse_args(typed, exit_on_error=False, print_error=False)
    return command, bound


def _check_names(words: str, function: Callable[..., Any], arguments: Sequence[str]) -> None:
    """Refuse an option that the command has not, with the nearest that it has, and an option that is given twice."""
    from millfrf.core import InputError
    from millfrf.core.steps import describe

    described = describe(inspect.unwrap(function)).options
    named = [option for option in described if option.public and not option.positional]
    names = [option.typed for option in named] + [f"--{name}" for name in flags_of(words)]
    once = [option.typed for option in named if not option.repeatable]
    typed = [word.partition("=")[0] for word in arguments]
    for name in typed:
        if name in once and typed.count(name) > 1:
            raise InputError(f"{name} is given {typed.count(name)} times; give it once")
        if name.startswith("--") and name not in names:
            near = [known for known in names if known.startswith(name)] or difflib.get_close_matches(name, names, 1)
            remedy = f"did you mean {near[0]}?" if near else f"'millfrf {words} --help' lists the options"
            raise InputError(f"millfrf {words} has no option {name}; {remedy}")


def _check_whole_numbers(function: Callable[..., Any], typed: Sequence[str]) -> None:
    """Refuse ``20.5`` where a whole number is wanted: the parser would cut it to 20 and say nothing."""
    from millfrf.core import InputError
    from millfrf.core.steps import describe

    kinds = {option.typed: option.number_types for option in describe(inspect.unwrap(function)).options}
    for place, word in enumerate(typed):
        name, joined, value = word.partition("=")
        numbers = [value] if joined else typed[place + 1 :]
        for kind, number in zip(kinds.get(name, ()), numbers, strict=False):
            if kind is int and _is_number(number) and not re.fullmatch(r"[+-]?\d+", number):
                raise InputError(f"{name} {number}: give a whole number")


def help_of(words: str) -> str:
    """Help of a command as text: usage, what it does, arguments and options, an example.

    Parameters
    ----------
    words
        Words of the command.
    """
    from millfrf.core.steps import describe

    described = describe(inspect.unwrap(function_of(words)))
    options = [option for option in described.options if option.public]
    arguments = [option.typed for option in options if option.positional]
    named = [option for option in options if not option.positional]
    needed = [f"{option.typed} {option.marker.metavar}" for option in named if option.needed]
    parts = [f"Usage: millfrf {' '.join([words, *arguments, *needed, '[OPTIONS]'])}"]
    parts += [textwrap.fill(_plain(text), WIDTH) for text in (described.summary, *described.paragraphs)]
    rows = [(option.typed, help_text(option)) for option in options if option.positional]
    parts += [_listed("Arguments", rows)] if rows else []
    rows = [(f"{option.typed} {option.marker.metavar}".strip(), help_text(option)) for option in named]
    rows += [(f"--{name}", COMMON[name]) for name in flags_of(words)]
    parts += [_listed("Options", rows)]
    parts += [f"Example:\n  {described.example}"] if described.example else []
    return "\n\n".join(parts)


WIDTH = 100


def help_text(option: "Option") -> str:
    """Meaning of an option with its unit and its default, for help and reference.

    Parameters
    ----------
    option
        Option of a step.
    """
    default = default_text(option)
    unit = f" [{option.unit}]" if option.unit else ""
    shown = " [needed]" if option.needed and not option.positional else f" [default: {default}]" if default else ""
    return f"{_plain(option.text)}{unit}{shown}"


def default_text(option: "Option") -> str:
    """Default of an option as it would be typed; empty where there is none."""
    value = option.default
    if value in (None, False, (), "") or value is inspect.Parameter.empty:
        return ""
    return " ".join(f"{number:g}" for number in value) if isinstance(value, tuple) else str(value)


def flags_of(words: str) -> list[str]:
    """Flags that a command has besides the options of its step.

    Parameters
    ----------
    words
        Words of the command.
    """
    from millfrf.core.steps import outputs_of

    guarded = words == "convert" or (outputs_of(function_of(words)) and words not in CONTINUED)
    return [name for name in COMMON if name != "force" or guarded]


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

    def command(*arguments: Any, **given: Any) -> int:
        common = {name: given.pop(f"common_{name}", False) for name in COMMON}
        return call(words, function, arguments, given, **common)

    parameters = []
    for option in describe(inspect.unwrap(function)).options:
        if not option.public:
            continue
        text = _plain(option.text) + (f" [{option.unit}]" if option.unit else "")
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
    given: Mapping[str, Any],
    *,
    force: bool = False,
    quiet: bool = False,
    json: bool = False,
) -> int:
    """Call a step as a command: outputs are guarded, the answer is printed in words or as one JSON document.

    Parameters
    ----------
    words, function
        Words of the command, and its step.
    arguments, given
        Positional and named arguments of the step.
    force
        Replace files that are there.
    quiet
        Print warnings and the answer alone.
    json
        Print the answer as one JSON document.
    """
    from millfrf.core import keeping_files, notices_to
    from millfrf.core.steps import check_outputs, refuse_outputs
    from millfrf.core.terminal import aside, print_document, speaking

    bound = inspect.signature(function).bind(*arguments, **given).arguments
    guarded = not force and words not in CONTINUED
    with (
        speaking(quiet=quiet, as_json=json) as manner,
        notices_to(_ignore if quiet else aside),
        keeping_files(REMEDY if guarded else None) as written,
    ):
        if guarded:
            check_outputs(function, bound)
            refuse_outputs(function, bound)
        function(*arguments, **given)
        if json:
            print_document(words, manner, written())
    return manner.exit_code


def _ignore(text: str) -> None:
    del text


def with_present_names(words: str, arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Give arguments with the names that options have now, and a note for each that was changed.

    Examples
    --------
    >>> with_present_names("robot modes", ["kuka_kr90_r3100", "--count", "4"])
    (['kuka_kr90_r3100', '--modes', '4'], ['--count of robot modes is called --modes now'])
    """
    names = FORMER_NAMES.get(words, {})
    result, notes = [], []
    for word in arguments:
        option, joined, value = word.partition("=")
        if option in names:
            notes.append(f"{option} of {words} is called {names[option]} now")
        result.append(names.get(option, option) + joined + value)
    return result, notes


def with_lists_apart(arguments: Sequence[str], function: Callable[..., Any]) -> list[str]:
    """Give arguments with each list of numbers as words of its own: ``--band 5,20`` and ``--band 5 20`` are equal.

    A single number stands for all where an option takes shares.

    Parameters
    ----------
    arguments
        Words behind the command.
    function
        The step, whose signature says how many numbers an option takes.

    Raises
    ------
    InputError
        A list with commas of another length than its option takes.
    """
    from millfrf.core import InputError
    from millfrf.core.steps import describe

    options = {option.typed: option for option in describe(inspect.unwrap(function)).options if option.count > 1}
    result: list[str] = []
    rest = list(arguments)
    while rest:
        name, joined, value = rest.pop(0).partition("=")
        option = options.get(name)
        if option is None or not (joined or rest):
            if not joined and name.startswith("--") and rest and re.match(r"-[\d.][^,]*,", rest[0]):
                joined, value = "=", rest.pop(0)  # joints such as -10,20,90: the parser would take them for an option
            result.append(name + joined + value)
            continue
        typed = value if joined else rest.pop(0)
        alone = not (rest and _is_number(rest[0]))
        numbers = _numbers(name, typed, option.count, alone and option.marker.metavar == "F D S")
        while len(numbers) < option.count and rest and _is_number(rest[0]):
            numbers.append(rest.pop(0))
        if len(numbers) != option.count or not all(map(_is_number, numbers)):
            raise InputError(f"{name} {' '.join(numbers)}: give {option.count} numbers {option.marker.metavar}")
        result += [name, *numbers]
    return result


def _numbers(name: str, typed: str, count: int, one_for_all: bool) -> list[str]:
    """Words that one word behind an option stands for: itself, the parts of a list, or one number for all."""
    from millfrf.core import InputError

    parts = [part.strip() for part in typed.split(",") if part.strip()]
    if len(parts) == 1 and one_for_all and _is_number(parts[0]):
        return parts * count
    if "," not in typed:
        return [typed]
    if len(parts) != count:
        more = ", or one for all" if one_for_all else ""
        raise InputError(f"{name} {typed}: give {count} numbers with commas and no spaces between them{more}")
    return parts


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _say_in_one_line(usual: Callable[..., None], message: object, category: type[Warning], *where: Any) -> None:
    """Print what was removed as a note; other warnings go their usual way."""
    from millfrf.core import LeftoverRemoved
    from millfrf.core.terminal import aside

    if issubclass(category, LeftoverRemoved):
        aside(str(message))
    else:
        usual(message, category, *where)


def _explain(error: Exception) -> int:
    """One line and the exit code for whatever ended a command."""
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
    """A fault of the program: where it stopped, without the messages of the libraries underneath."""
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
