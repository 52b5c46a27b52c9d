"""The command line `millfrf`: one verb a job; exit code 0 done, 1 the run failed, 2 bad input."""

import os
import signal
import sys
import traceback
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from millfrf.core import InputError, LeftoverRemoved, MillfrfError, MillfrfWarning, is_disk_full
from millfrf.core.terminal import manner, printable, say

from .commands import COMMANDS
from .cut.commands import cut_app
from .new.new_commands import new_app
from .robot.commands import robot_app
from .usage import framed, options_of_several, usage_in_words, with_examples, with_lists_apart, with_names_of_today
from .version import __version__

DONE, FAILED, BAD_INPUT = 0, 1, 2
INTERRUPTED = 130
"""What newer versions of typer return instead of raising KeyboardInterrupt."""
STOPPED = "stopped; unfinished files were removed"

app = typer.Typer(
    name="millfrf",
    help="FRFs of machining robots measured while they mill, their modal fit and stability lobes.",
    add_completion=True,
    no_args_is_help=False,
    rich_markup_mode=None,
)


def _show_version(asked: bool) -> None:
    """Print name and version, and end."""
    if asked:
        say(f"millfrf {__version__}")
        raise typer.Exit


@app.callback()
def _program(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_show_version, help="Show the version and end.")
    ] = False,
) -> None:
    """FRFs of machining robots measured while they mill, their modal fit and stability lobes."""
    del version


for _function in COMMANDS:
    app.command(_function.__name__)(framed(_function.__name__, _function))
app.add_typer(robot_app)
app.add_typer(new_app)
app.add_typer(cut_app)


def run(arguments: Sequence[str]) -> int:
    """Run one command line and return its exit code; a failure is one line on standard error.

    Set ``MILLFRF_TRACEBACK=1`` to see where an unexpected failure came from.
    """
    command = with_examples(typer.main.get_command(app))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", MillfrfWarning)  # each command prints the doubts of its result
            warnings.simplefilter("always", LeftoverRemoved)
            warnings.showwarning = partial(_say_in_one_line, warnings.showwarning)
            words = _as_today(arguments)
            words = with_lists_apart(words, options_of_several(command, words))
            result = command.main(args=words, prog_name="millfrf", standalone_mode=False)
    except (KeyboardInterrupt, typer.Abort):
        return _fail(STOPPED, FAILED)
    except Exception as error:
        return _explain(error, arguments)
    if result == INTERRUPTED:
        return _fail(STOPPED, FAILED)
    return result if isinstance(result, int) else DONE


def _as_today(arguments: Sequence[str]) -> list[str]:
    """The words with the names that options have now; a note tells what has changed."""
    words, notes = with_names_of_today(arguments)
    for one in [] if "--quiet" in words else notes:
        print(f"note: {printable(one)}", file=sys.stderr)
    return words


def _say_in_one_line(usual: Callable[..., None], message: object, category: type[Warning], *where: Any) -> None:
    """Print what was removed as a note; other warnings go their usual way."""
    if issubclass(category, LeftoverRemoved):
        if not manner().quiet:
            print(f"note: {printable(str(message))}", file=sys.stderr)
    else:
        usual(message, category, *where)


def _explain(error: Exception, arguments: Sequence[str]) -> int:
    """One line and the exit code for whatever ended a command."""
    if isinstance(error, InputError):
        return _fail(str(error), BAD_INPUT)
    if isinstance(error, MillfrfError):
        return _fail(str(error), FAILED)
    usage = getattr(error, "format_message", None)  # a wrong option, whichever click typer brings along
    if callable(usage):
        command = getattr(getattr(error, "ctx", None), "command_path", "millfrf")
        return _fail(usage_in_words(str(usage()), arguments, command), BAD_INPUT)
    if os.environ.get("MILLFRF_TRACEBACK"):
        raise error
    if is_disk_full(error):
        return _fail(f"no room for {getattr(error, 'filename', None) or 'temporary files'}; free space first", FAILED)
    if isinstance(error, OSError):
        return _fail(f"{error.filename or 'a file'}: {error.strerror or error}", FAILED)
    return _fail(_unforeseen(error), FAILED)


def _unforeseen(error: Exception) -> str:
    """A fault of the program: where it stopped, without the words of the libraries underneath."""
    if isinstance(error, MemoryError):
        return "not enough memory; ask for fewer lines, speeds or samples"
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if "site-packages" not in frame.filename]
    place = f"{Path(frames[-1].filename).name}, line {frames[-1].lineno}" if frames else "an unknown place"
    return (
        f"the program met something that it does not foresee ({place}); look at the inputs with 'millfrf inspect', and "
        "report it with the files if nothing looks wrong; MILLFRF_TRACEBACK=1 shows more"
    )


def _fail(message: str, code: int) -> int:
    print("millfrf: " + printable(" ".join(message.split())), file=sys.stderr)
    return code


def _stop_in_order(owner: int, number: int, frame: object) -> None:
    """End as by Ctrl-C, so that unfinished files are removed; a helper process of the program ends at once."""
    del frame
    if os.getpid() != owner:
        os._exit(128 + number)
    raise KeyboardInterrupt


def main() -> None:
    """Entry point of the program ``millfrf``."""
    signal.signal(signal.SIGTERM, partial(_stop_in_order, os.getpid()))
    sys.exit(run(sys.argv[1:]))


if __name__ == "__main__":
    main()
