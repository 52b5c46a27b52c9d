"""Commented TOML templates."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import tomlkit

from millfrf.core import writing_whole_file
from millfrf.core.described_tables import DescribedKey, DescribedTable, TomlFile, described_tables

from .guesses import Question
from .toml_files import toml_files

FILL_IN = "FILL IN"
"""Mark of a key that must be given and that nothing tells; the command that reads the file names it as missing."""

_WIDTH = 110

Row = Mapping[str, Any]


def template(title: str, tables: Sequence[DescribedTable], rows: Mapping[str, Sequence[Row]]) -> str:
    """Text of a commented TOML file.

    Parameters
    ----------
    title
        First lines of the file, without the ``#``.
    tables
        Tables in their order; one that is not in ``rows`` is written as a comment as a whole.
    rows
        Values or questions by heading (`[arrays.H]` for a table `[arrays.NAME]`), a row a table; keys without a value
        stand there as comments. Only the first row of several explains its keys.
    """
    parts = [*(f"# {line}" for line in title.splitlines()), ""]
    for table in tables:
        given = [(heading, row) for heading in rows if _is_of(heading, table) for row in rows[heading]]
        if not given and table.heading:
            parts += ["", *(_hidden(table))]
        for number, (heading, row) in enumerate(given):
            parts += ["", *_table(replace(table, heading=heading), row, explained=number == 0)]
    return "\n".join(parts) + "\n"


def _is_of(heading: str, table: DescribedTable) -> bool:
    """Whether a heading is that of a table; `NAME` in the table's stands for any name."""
    return re.fullmatch(re.escape(table.heading).replace("NAME", r"(\"[^\"]+\"|[^.\[\]]+)"), heading) is not None


def _table(table: DescribedTable, row: Row, *, explained: bool) -> Iterator[str]:
    if table.heading:
        yield table.heading
    for text, keys in groupby(_plain_keys(table), key=lambda key: key.text):
        together = tuple(keys)
        if explained:
            yield from _wrapped(_explanation(text, together, given=all(key.name in row for key in together)))
        shown = [key for key in together if explained or key.name in row or key.default is None]
        yield from (_line(key, row, marked=not explained) for key in shown)
        if explained:
            yield ""


def _hidden(table: DescribedTable) -> Iterator[str]:
    yield from _wrapped(table.text)
    yield f"# {table.heading}"
    for text, keys in groupby(_plain_keys(table), key=lambda key: key.text):
        together = tuple(keys)
        yield from _wrapped(_explanation(text, together, given=True), "#     ")
        yield from (_line(key, {}, marked=False) for key in together)


def _plain_keys(table: DescribedTable) -> Iterator[DescribedKey]:
    """Keys that hold no table: tables have headings of their own."""
    return (key for key in table.keys if key.kind not in ("table", "tables by name", "list of tables"))


def _explanation(text: str, keys: Sequence[DescribedKey], *, given: bool) -> str:
    first = keys[0]
    needed = f" -- {FILL_IN}" if first.default is None and not given else ""
    unit = f", {first.unit}" if first.unit else ""
    return f"{text} ({first.kind}{unit}){needed}".replace("`", "")


def _line(key: DescribedKey, row: Row, *, marked: bool) -> str:
    """Key and value; as a comment where there is none, with the question where there is one."""
    asked = row.get(key.name)
    if isinstance(asked, Question):
        place = f"{key.name} = {asked.refused}" if asked.refused else f"# {key.name} ="
        return f"{place}    # {f'{FILL_IN}: ' if asked.open else ''}{asked.text}"
    if key.name in row:
        return f"{key.name} = {tomlkit.item(row[key.name]).as_string()}"
    mark = f"    # {FILL_IN}" if marked and key.default is None else ""
    return f"# {key.name} = {'' if key.default is None else _default(key)}".rstrip() + mark


def _default(key: DescribedKey) -> str:
    """The default as TOML writes it; nothing where there is none."""
    if not key.default:
        return ""
    plain = key.kind.startswith(("number", "whole", "list", "true"))
    return key.default if plain else tomlkit.item(key.default).as_string()


def _wrapped(text: str, mark: str = "# ") -> Iterator[str]:
    line = ""
    for word in text.split():
        if len(line) + len(word) > _WIDTH:
            yield f"{mark}{line}"
            line = ""
        line = f"{line} {word}".strip()
    yield f"{mark}{line}"


def cut_text(teeth: int | None, diameter: float | None, *, plan: bool) -> str:
    """Text of a cutting file; ``diameter`` in m. With ``plan`` it has the table of a plan, too."""
    given: dict[str, Any] = {}
    if teeth is not None:
        given["teeth"] = teeth
    if diameter is not None:
        given["diameter_m"] = diameter
    given |= _engagement(diameter)
    tables = [*described_tables(_kind("cut")), *(described_tables(_kind("plan")) if plan else ())]
    rows: dict[str, Sequence[Row]] = {"[cutting]": [given], "[plan]": [{}]}
    title = (
        f"A cut: cutter, engagement, force coefficients. Marked {FILL_IN}: what must be given.\n"
        "The engagement is start_angle_deg and exit_angle_deg, or immersion (with radial_depth_m)."
    )
    return template(title, tables, rows)


def _engagement(diameter: float | None) -> dict[str, Question]:
    """What is asked of the engagement; ``diameter`` in m."""
    half = "diameter_m / 2" if diameter is None else f"{diameter / 2:g}"
    return {
        "start_angle_deg": Question("give this and exit_angle_deg only instead of immersion", open=False),
        "immersion": Question('"up", "down", "central" or "slot"; or both angles above'),
        "radial_depth_m": Question(f"width of cut; half immersion, up or down: {half}; not for a slot or with angles"),
    }


def session_text(driver: str, n_channels: int) -> str:
    """Text of a session file for a device: ``ni``, ``replay`` or ``simulated``."""
    kind = _kind("session")
    tables = [table for table in described_tables(kind) if table.heading != "[device]" or _drives(table, driver)]
    rows: dict[str, Sequence[Row]] = {"": [{}], "[device]": [{"driver": driver}]}
    if driver == "ni":
        rows["[[channels]]"] = [{} for _ in range(n_channels)]
    title = (
        f"A session for: millfrf acquire THIS.toml --out REC.h5. Marked {FILL_IN}: what must be given.\n"
        "Tables that stand as comments are not used; take the # away where the rig has such a device."
    )
    return template(title, tables, rows)


def campaign_text(files: Sequence[str], robot: str | None) -> str:
    """Text of a campaign file for recordings by name, and a robot where its postures matter."""
    rows: dict[str, Sequence[Row]] = {
        "[campaign]": [{} if robot is None else {"robot": robot}],
        "[[recordings]]": [{"files": list(files)}],
        "[sets]": [{}],
        "[fit]": [{}],
        "[report]": [{}],
    }
    title = (
        f"A campaign for: millfrf campaign THIS.toml --dry-run. Marked {FILL_IN}: what must be given.\n"
        "A job is done if its table is there: take the # away from [estimate], [calibrate], [lobes], [diagnose] ..."
    )
    return template(title, described_tables(_kind("campaign")), rows)


def _kind(name: str) -> TomlFile:
    return next(file for file in toml_files() if file.name == name)


def _drives(table: DescribedTable, driver: str) -> bool:
    return any(key.name == "driver" and key.kind == f"`{driver}`" for key in table.keys)


def write_new(out: Path, text: str) -> None:
    """Write a template whole."""
    with writing_whole_file(out) as temporary:
        temporary.write_text(text, encoding="utf-8")
