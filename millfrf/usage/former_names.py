"""Names that options had before: scripts that use them go on, and are told the new name."""

from collections.abc import Mapping, Sequence

FORMER_NAMES: Mapping[str, Mapping[str, str]] = {
    "robot lobes": {"--angles": "--turns"},
    "robot path": {"--table": "--table-turns"},
    "robot modes": {"--count": "--modes"},
    "robot deviation": {
        "--spindle-speed": "--speed",
        "--force-error": "--force-uncertainty",
        "--stiffness-error": "--stiffness-uncertainty",
    },
    "robot frf": {"--sensor": "--sensor-at"},
    "robot update": {"--sensor": "--sensor-at", "--feed": "--channels-turned"},
    "robot diagnose": {"--sensor": "--sensor-at", "--feed": "--channels-turned"},
    "robot learn": {"--feed": "--channels-turned"},
    "new robot": {"--tip": "--flange"},
}
"""Former name and name of today, by the words of the command; no help shows the former ones."""


def with_names_of_today(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Give the words of a command line with the names that options have now, and a note for each that was changed.

    Parameters
    ----------
    arguments
        The words as they were typed.

    Examples
    --------
    >>> with_names_of_today(["robot", "modes", "kuka_kr90_r3100", "--count", "4"])
    (['robot', 'modes', 'kuka_kr90_r3100', '--modes', '4'], ['--count of robot modes is called --modes now'])
    """
    words = " ".join(arguments[:2])
    names = FORMER_NAMES.get(words, {})
    result, notes = [], []
    for word in arguments:
        option, joined, value = word.partition("=")
        if option in names:
            notes.append(f"{option} of {words} is called {names[option]} now")
        result.append(names.get(option, option) + joined + value)
    return result, notes
