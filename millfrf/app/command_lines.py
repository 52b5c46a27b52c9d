"""A step as the page runs it: its command line, and the same call in Python."""

import inspect
import shlex
from dataclasses import dataclass

from millfrf.command_line import flags_of, parse
from millfrf.commands import STEPS, function_of, words_of
from millfrf.core import InputError
from millfrf.core.steps import outputs_of


@dataclass(frozen=True)
class CommandLine:
    """Words of a command without ``millfrf`` in front.

    Parameters
    ----------
    words
        Words of the command, such as ``("fit", "frf.h5", "--out", "model.json")``.
    """

    words: tuple[str, ...]

    @property
    def name(self) -> str:
        """Words that name the command, such as ``cut identify``.

        Raises
        ------
        InputError
            There is no such command.
        """
        name = words_of(self.words)
        if not name:
            raise InputError(f"there is no command {' '.join(self.words[:2])!r}; see millfrf --help")
        return name

    @property
    def text(self) -> str:
        """The command as it is typed in a terminal.

        Examples
        --------
        >>> CommandLine(("fit", "my frf.h5", "--out", "model.json")).text
        "millfrf fit 'my frf.h5' --out model.json"
        """
        return f"millfrf {shlex.join(self.words)}"

    @property
    def python(self) -> str:
        """The same call in Python.

        Examples
        --------
        >>> CommandLine(("fit", "frf.h5", "--band", "5", "60", "--out", "model.json")).python.splitlines()[1]
        'result = mf.fit("frf.h5", out="model.json", band=(5.0, 60.0))'
        """
        bound = self._bound()
        positional = [_literal(value) for value in bound.args]
        named = [f"{key}={_literal(value)}" for key, value in bound.kwargs.items()]
        module, _, function = STEPS[self.name].partition(":")
        call = f"({', '.join([*positional, *named])})"
        short = self.name.replace(" ", "_")
        if short in _of_package():
            return f"import millfrf as mf\nresult = mf.{short}{call}\nprint(result)"
        return f"from {module} import {function}\nresult = {function}{call}\nprint(result)"

    @property
    def outputs(self) -> tuple[str, ...]:
        """Files and folders that the command writes.

        Examples
        --------
        >>> CommandLine(("convert", "cut.mat", "cut.h5")).outputs
        ('cut.h5',)
        """
        bound = self._bound()
        if self.name == "convert":  # its last file is the output
            return (str(bound.args[-1]),)
        values = [bound.kwargs.get(option.name) for option in outputs_of(function_of(self.name))]
        return tuple(str(value) for value in values if value is not None)

    def _bound(self) -> inspect.BoundArguments:
        words = [word for word in self.words[len(self.name.split()) :] if word != "--force"]
        return parse(self.name, words)[1]

    @property
    def repeatable(self) -> "CommandLine":
        """The command with ``--force``, where it has that flag, so that it replaces its own earlier outputs."""
        if "--force" in self.words or "force" not in flags_of(self.name):
            return self
        return CommandLine((*self.words, "--force"))

    @classmethod
    def from_text(cls, text: str) -> "CommandLine":
        """Read a command as it is typed.

        Raises
        ------
        InputError
            A quotation that is not closed.

        Examples
        --------
        >>> CommandLine.from_text("millfrf fit 'my frf.h5'").words
        ('fit', 'my frf.h5')
        """
        try:
            words = shlex.split(text)
        except ValueError as error:
            raise InputError(f"{text!r} is no command: {error}") from error
        return cls(tuple(words[1:] if words[:1] == ["millfrf"] else words))


def _of_package() -> tuple[str, ...]:
    """Names of ``import millfrf``."""
    import millfrf

    return tuple(millfrf.__all__)


def _literal(value: object) -> str:
    """Show a value as Python source with double quotes; a path is a text."""
    if isinstance(value, tuple | list):
        parts = [_literal(part) for part in value]
        return f"({', '.join(parts)}{',' if len(parts) == 1 else ''})"
    if isinstance(value, bool | int | float) or value is None:
        return repr(value)
    return '"' + str(value).replace("\\", "\\\\").replace('"', '\\"') + '"'
