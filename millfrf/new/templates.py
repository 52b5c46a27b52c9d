"""Steps ``new cut``, ``session``, ``campaign``, ``schemas``: commented TOML files, their kinds and schemas."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tomlkit
from annotated_types import Ge, Gt, Le

from acquisition import Question
from millfrf.core import InputError, writing_whole_file, writing_whole_folder
from millfrf.core.described_tables import DescribedKey, DescribedTable, TomlFile, described_tables, json_schema
from millfrf.core.steps import File, Typed, Writes, step
from millfrf.core.terminal import say, say_written
from millfrf.cutting import CutterShape

if TYPE_CHECKING:
    from millfrf.cutting.published_coefficients import PublishedCoefficients

NewFile = Annotated[File | None, Writes(suffixes=(".toml",), needed=True)]
Row = Mapping[str, Any]

Material = Literal["acetal", "aluminium", "aluminium-6082-t6", "aluminium-7075", "aluminium-7075-t6"]

# mark of a key that must be given; the command that reads the file reports it as missing
FILL_IN = "FILL IN"
_WIDTH = 110  # characters of a comment line


@step
def new_cut(
    *,
    out: NewFile = None,
    teeth: Annotated[int | None, Typed("N"), Ge(1)] = None,
    diameter: Annotated[float | None, Typed("M"), Gt(0)] = None,
    cutter: CutterShape | None = None,
    material: Material | None = None,
    turning: bool = False,
    plan: bool = False,
) -> str:
    """Write a commented cutting file; values that you must fill in are marked.

    Parameters
    ----------
    out
        Cutting file to write.
    teeth
        Number of cutting edges.
    diameter : m
        Diameter of the cutter.
    cutter
        Shape of the cutter where it is no square end mill.
    material
        Material whose published force coefficients are the starting values, with their source; measure your own by
        `millfrf cut identify`.
    turning
        Describe turning or boring: a workpiece that turns, and one edge.
    plan
        Add the table of a plan of speed sweeps.

    Returns
    -------
    str
        Text of the file.

    Examples
    --------
    ::

        $ millfrf new cut --teeth 2 --diameter 0.0127 --out cut.toml
    """
    given: dict[str, Any] = {"teeth": teeth, "diameter_m": diameter}
    if material is not None:
        given |= _published(material).entries
    if turning:
        if teeth is not None or cutter is not None or plan:
            raise InputError("turning has one edge and excites at no frequency: leave out --teeth, --cutter and --plan")
        return _new_turning(out, given, material)
    rows: dict[str, Sequence[Row]] = {
        "[cutting]": [{key: value for key, value in given.items() if value is not None} | _engagement(diameter)],
        "[plan]": [{}],
    }
    if cutter is not None:
        rows["[cutter]"] = [{"shape": cutter}]
    title = (
        f"A cut: cutter, engagement, force coefficients. Marked {FILL_IN}: what must be given.\n"
        "The engagement is start_angle_deg and exit_angle_deg, or immersion (with radial_depth_m)."
    )
    kinds = ["cut", *(["cutter"] if cutter else ()), *(["plan"] if plan else ())]
    tables = [table for kind in kinds for table in described_tables(_kind(kind))]
    title = "\n".join([title, *_origin(material)])
    return _written(out, template(title, tables, rows), "millfrf lobes MODEL.json --cutting {} ...")


def _new_turning(out: File | None, given: dict[str, Any], material: str | None) -> str:
    """Write the file of a turning cut with the given keys."""
    names = [key.name for table in described_tables(_kind("turning")) for key in table.keys]
    row = {key: value for key, value in given.items() if value is not None and key in names}
    title = [f"A turning or boring cut: tool, workpiece, force coefficients. Marked {FILL_IN}: what must be given."]
    text = template("\n".join([*title, *_origin(material)]), described_tables(_kind("turning")), {"[turning]": [row]})
    return _written(out, text, "millfrf lobes MODEL.json --cutting {} ...")


@step
def new_session(
    *,
    out: NewFile = None,
    driver: Literal["ni", "replay", "simulated"] = "ni",
    channels: Annotated[int, Typed("N"), Ge(1), Le(256)] = 6,
) -> str:
    """Write a commented session file for `millfrf acquire`.

    Parameters
    ----------
    out
        Session file to write.
    driver
        Device that samples.
    channels
        Number of inputs to describe.

    Returns
    -------
    str
        Text of the file.

    Examples
    --------
    ::

        $ millfrf new session --driver ni --channels 6 --out session.toml
    """
    tables = [
        table for table in described_tables(_kind("session")) if table.heading != "[device]" or _drives(table, driver)
    ]
    rows: dict[str, Sequence[Row]] = {"": [{}], "[device]": [{"driver": driver}]}
    if driver == "ni":
        rows["[[channels]]"] = [{} for _ in range(channels)]
    title = (
        f"A session for: millfrf acquire THIS.toml --out REC.h5. Marked {FILL_IN}: what must be given.\n"
        "Tables that stand as comments are not used; take the # away where the rig has such a device."
    )
    return _written(out, template(title, tables, rows), "millfrf acquire {} --check")


@step
def new_campaign(
    *recordings: Annotated[str, Typed("REC")],
    out: NewFile = None,
    robot: Annotated[str, Typed("ROBOT")] | None = None,
) -> str:
    """Write a commented campaign file for `millfrf campaign`.

    Parameters
    ----------
    recordings
        Names of recordings; quoted, with wildcards: 'recordings/*.h5'.
    out
        Campaign file to write.
    robot
        Robot whose postures were measured.

    Returns
    -------
    str
        Text of the file.

    Raises
    ------
    InputError
        No recording.

    Examples
    --------
    ::

        $ millfrf new campaign 'recordings/*.h5' --robot kuka_kr90_r3100 --out campaign.toml
    """
    if not recordings:
        raise InputError("no recording given; name recordings, or quote a name with wildcards: 'recordings/*.h5'")
    rows: dict[str, Sequence[Row]] = {
        "[campaign]": [{} if robot is None else {"robot": robot}],
        "[[recordings]]": [{"files": list(recordings)}],
        "[sets]": [{}],
        "[fit]": [{}],
        "[report]": [{}],
    }
    title = (
        f"A campaign for: millfrf campaign THIS.toml --dry-run. Marked {FILL_IN}: what must be given.\n"
        "A job is done if its table is there: take the # away from [estimate], [calibrate], [lobes], [diagnose] ..."
    )
    return _written(out, template(title, described_tables(_kind("campaign")), rows), "millfrf campaign {} --dry-run")


@step
def new_schemas(*, out: Annotated[File | None, Writes("DIR", needed=True)] = None) -> dict[str, dict[str, Any]]:
    """Write a JSON schema of each kind of TOML file, for editors that complete and check keys.

    Parameters
    ----------
    out
        Folder for the schemas.

    Returns
    -------
    dict of dict
        Schemas by the kind of file.

    Examples
    --------
    ::

        $ millfrf new schemas --out schemas
    """
    schemas = {file.name: json_schema(file) for file in toml_files()}
    if out is not None:
        with writing_whole_folder(out) as folder:
            for name, schema in schemas.items():
                (folder / f"{name}.schema.json").write_text(json.dumps(schema, indent=2) + "\n", encoding="utf-8")
    say(f"wrote {len(schemas)} schemas into {out}; first line of a TOML file: #:schema PATH.schema.json")
    return schemas


def _written(out: File | None, text: str, then: str) -> str:
    """Write a template, print which command reads it, and return it."""
    if out is not None:
        write_new(Path(out), text)
    say_written([out], f"fill in what is marked {FILL_IN}, then: {then.format(out)}")
    return text


def write_new(out: Path, text: str) -> None:
    with writing_whole_file(out) as temporary:
        temporary.write_text(text, encoding="utf-8")


def template(title: str, tables: Sequence[DescribedTable], rows: Mapping[str, Sequence[Row]]) -> str:
    """Return the text of a commented TOML file."""
    parts = [*(f"# {line}" for line in title.splitlines()), ""]
    for table in tables:
        given = [(heading, row) for heading in rows if _is_of(heading, table) for row in rows[heading]]
        if not given and table.heading:
            parts += ["", *(_hidden(table))]
        for number, (heading, row) in enumerate(given):
            parts += ["", *_table(replace(table, heading=heading), row, explained=number == 0)]
    return "\n".join(parts) + "\n"


def _is_of(heading: str, table: DescribedTable) -> bool:
    """Return whether a heading belongs to a table; `NAME` in the table is a placeholder."""
    return re.fullmatch(re.escape(table.heading).replace("NAME", r"(\"[^\"]+\"|[^.\[\]]+)"), heading) is not None


def _table(table: DescribedTable, row: Row, *, explained: bool) -> Iterator[str]:
    if table.heading:
        yield table.heading
    for text, keys in groupby(_plain_keys(table), key=lambda key: key.text):
        group = tuple(keys)
        if explained:
            yield from _wrapped(_explanation(text, group, given=all(key.name in row for key in group)))
        shown = [key for key in group if explained or key.name in row or key.default is None]
        yield from (_line(key, row, marked=not explained) for key in shown)
        if explained:
            yield ""


def _hidden(table: DescribedTable) -> Iterator[str]:
    yield from _wrapped(table.text)
    yield f"# {table.heading}"
    for text, keys in groupby(_plain_keys(table), key=lambda key: key.text):
        group = tuple(keys)
        yield from _wrapped(_explanation(text, group, given=True), "#     ")
        yield from (_line(key, {}, marked=False) for key in group)


def _plain_keys(table: DescribedTable) -> Iterator[DescribedKey]:
    """Yield the keys that are no tables; tables are written with a heading."""
    return (key for key in table.keys if key.kind not in ("table", "tables by name", "list of tables"))


def _explanation(text: str, keys: Sequence[DescribedKey], *, given: bool) -> str:
    first = keys[0]
    needed = f" -- {FILL_IN}" if first.default is None and not given else ""
    unit = f", {first.unit}" if first.unit else ""
    return f"{text} ({first.kind}{unit}){needed}".replace("`", "")


def _line(key: DescribedKey, row: Row, *, marked: bool) -> str:
    """Format key and value; write a key without a value as a comment, with its question if there is one."""
    value = row.get(key.name)
    if isinstance(value, Question):
        place = f"{key.name} = {value.refused}" if value.refused else f"# {key.name} ="
        return f"{place}    # {f'{FILL_IN}: ' if value.open else ''}{value.text}"
    if key.name in row:
        return f"{key.name} = {tomlkit.item(row[key.name]).as_string()}"
    mark = f"    # {FILL_IN}" if marked and key.default is None else ""
    return f"# {key.name} = {'' if key.default is None else _default(key)}".rstrip() + mark


def _default(key: DescribedKey) -> str:
    """Format the default as TOML; return an empty text if there is no default."""
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


def _published(material: str) -> "PublishedCoefficients":
    from millfrf.cutting import PUBLISHED

    return PUBLISHED[material]


def _origin(material: str | None) -> Iterator[str]:
    """Return lines on where published force coefficients come from."""
    if material is not None:
        published = _published(material)
        yield from _wrapped(f"Force coefficients: {published.material}; {published.conditions}.", "")
        yield from _wrapped(f"From: {published.source}.", "")
        yield "Starting values: two sources of one alloy differ by a fifth. Measure yours: millfrf cut identify."


def _engagement(diameter: float | None) -> dict[str, Question]:
    """Return the questions on the engagement; ``diameter`` in m."""
    half = "diameter_m / 2" if diameter is None else f"{diameter / 2:g}"
    return {
        "start_angle_deg": Question("give this and exit_angle_deg only instead of immersion", open=False),
        "immersion": Question('"up", "down", "central" or "slot"; or both angles above'),
        "radial_depth_m": Question(f"width of cut; half immersion, up or down: {half}; not for a slot or with angles"),
    }


def _kind(name: str) -> TomlFile:
    return next(file for file in toml_files() if file.name == name)


def _drives(table: DescribedTable, driver: str) -> bool:
    return any(key.name == "driver" and key.kind == f"`{driver}`" for key in table.keys)


def toml_files() -> tuple[TomlFile, ...]:
    """Return all kinds of TOML files that commands read, in the usual order of work."""
    from acquisition import LogMapping, RecordingMapping, Session
    from estimation import FrfMapping, GeometryTable
    from millfrf.campaign.campaign_tables import CampaignFile
    from millfrf.cutting import CutterTable, CuttingTable, TurningTable
    from millfrf.robot_model import PlanarFile, SerialFile, SpatialFile
    from millfrf.steps.plan import PlanTable
    from millfrf.steps.tap_points import PointsTable
    from modal_fit import PolesFile, ToolTable

    cuts = ("lobes", "chatter", "plan", "report", "cut diagnose", "robot lobes", "robot path", "robot advice")
    robots = ("robot modes", "robot frf", "robot lobes", "robot map", "robot update", "robot path", "robot advice")
    return (
        TomlFile("mapping", "which array or column of a file is which channel", RecordingMapping, "", ("convert",)),
        TomlFile("frf-mapping", "where another program's file holds FRFs", FrfMapping, "", ("convert",)),
        TomlFile("can-mapping", "which signals of a CAN log go into a recording", LogMapping, "", ("convert",)),
        TomlFile("cut", "cutter, engagement and force coefficients", CuttingTable, "cutting", cuts),
        TomlFile("cutter", "shape of the cutter, in a cutting file", CutterTable, "cutter", cuts),
        TomlFile("turning", "turning and boring, in a cutting file", TurningTable, "turning", ("lobes", "report")),
        TomlFile("plan", "what sweeps of the spindle speed shall measure", PlanTable, "plan", ("plan",)),
        TomlFile("session", "what is recorded, from which devices", Session, "", ("acquire",)),
        TomlFile("points", "which point was hit in which recording", PointsTable, "", ("tap",)),
        TomlFile("geometry", "where the nodes are, and which lines join them", GeometryTable, "", ("report",)),
        TomlFile("tool", "a tool or blank as round segments, from the holder to the tip", ToolTable, "", ("tool",)),
        TomlFile("poles", "poles that are chosen by hand", PolesFile, "", ("fit",)),
        TomlFile("robot-serial", "a robot joint by joint, as `new robot` writes it", SerialFile, "", robots),
        TomlFile("robot-spatial", "a robot with closed loops, beams and own nodes", SpatialFile, "", robots),
        TomlFile("robot-planar", "a robot that moves in a plane", PlanarFile, "", robots),
        TomlFile("campaign", "many recordings, and the jobs that are done with them", CampaignFile, "", ("campaign",)),
    )
