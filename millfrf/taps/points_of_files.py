"""Points that the channels of each recording stand for: from a table, an option, or the files themselves."""

import os
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from acquisition import Channel, Recording
from estimation import TapTest, choose_channels
from millfrf.core import DegreeOfFreedom, InputError

from .options import TapOptions
from .points_table import PointRow, PointsTable, read_points


def tests_of(paths: Sequence[str | os.PathLike[str]], options: TapOptions) -> list[TapTest]:
    """One test a recording, or one for each of its rows in the table of points.

    The point hit is that of the table, else that of the option, else ``point`` in the table ``[hammer]`` of the
    recording's set-up, else that of the force channel. Sensors stand where the table says, else where their channels
    say.

    Raises
    ------
    InputError
        A file that the table does not have, a channel that the file does not have, a point for several force channels,
        or several files of which nothing says which point was hit.
    """
    table = None if options.points is None else read_points(options.points)
    tests = [test for path in paths for test in _tests(Path(path), table, options)]
    unknown = sorted({test.path.name for test in tests for channel in test.excitations if not channel.node})
    if unknown and len(tests) > 1:
        raise InputError(
            f"nothing says which point was hit in {', '.join(unknown[:5])}{' ...' if len(unknown) > 5 else ''}; give "
            "--points TABLE.csv with the columns file and hit, or --point NODE:DIRECTION if it was always the same"
        )
    return tests


def _tests(path: Path, table: PointsTable | None, options: TapOptions) -> list[TapTest]:
    with Recording(path) as recording:
        source = recording.stream(options.stream)
        forces = options.excitations or [channel.name for channel in source.channels if channel.quantity == "force"]
        exciting, responding = choose_channels(source, forces or None, options.responses or None)
        both = sorted({one.name for one in exciting} & {one.name for one in responding})
        if both:
            raise InputError(f"channel {both[0]} is named as excitation and as response; name it once")
        stated = options.point or _of_setup(recording.setup, path.name)
    if table is None:
        return [_test(path, exciting, responding, PointRow(file=path.name, hit=stated), options.stream)]
    rows = table.rows_of(path)
    if not rows:
        raise InputError(f"{path.name} is not in {options.points}; add a row that says which point was hit in it")
    rows = tuple(row if row.hit else row.model_copy(update={"hit": stated}) for row in rows)
    return [_test(path, exciting, responding, row, options.stream) for row in rows]


def _of_setup(setup: str, file: str) -> str:
    """``[hammer] point`` of a recording's set-up; empty where it has none."""
    try:
        hammer = tomllib.loads(setup).get("hammer", {})
    except tomllib.TOMLDecodeError:
        return ""
    point = str(hammer.get("point", "")) if isinstance(hammer, dict) else ""
    if point:
        try:
            DegreeOfFreedom.parse(point)
        except InputError as error:
            raise InputError(f"{file}: point in [hammer] of its set-up: {error}") from error
    return point


def _test(
    path: Path, exciting: Sequence[Channel], responding: Sequence[Channel], row: PointRow, stream: str | None
) -> TapTest:
    known = [channel.name for channel in (*exciting, *responding)]
    missing = [name for name in row.channels if name not in known]
    if missing:
        raise InputError(
            f"{path.name}: the table of points has a column or key {missing[0]!r}, which is none of the channels used "
            f"({', '.join(known)}); correct the name"
        )
    if row.hit and len(exciting) > 1:
        raise InputError(
            f"{path.name}: one point hit, {row.hit}, but {len(exciting)} forces ({', '.join(known[: len(exciting)])}); "
            "name the hammer's channel with --excitation, or each channel's place in the table"
        )
    places = {exciting[0].name: row.hit, **row.channels} if row.hit else dict(row.channels)
    return TapTest(
        path,
        tuple(_moved(channel, places.get(channel.name, "")) for channel in exciting),
        tuple(_moved(channel, places.get(channel.name, "")) for channel in responding),
        stream,
        row.span,
    )


def _moved(channel: Channel, place: str) -> Channel:
    """The channel at another place, where one is given."""
    if not place:
        return channel
    point = DegreeOfFreedom.parse(place)
    return replace(channel, node=point.node, direction=point.direction)
