"""The step from a robot's file and measurements to its updated file."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from millfrf.core import InputError, MillfrfError, writing_whole_file
from millfrf.robot_model import numbered_robot_text, read_robot, update_robot, updated_document

from ...options import check_output
from ...progress import bar
from ...provenance import add_comment, add_to_json, origin
from ...terminal import say, tell
from ..postures import spatial
from .asking import Asking
from .measured_files import read_measured
from .update_words import as_json, summary


def _check_readable(unfinished: Path, out: Path, lines: Sequence[str]) -> None:
    """Read the file before it takes its name: numbers may fit what was measured and still be no robot."""
    named = unfinished.with_suffix(".toml")  # a robot file is known by its suffix
    unfinished.rename(named)
    try:
        read_robot(named)
    except MillfrfError as error:
        why = str(error).replace(f"{named}: ", "")
        said = f"{out} was not written, for no robot has these numbers: {why}; are posture, axes and band right?"
        say("\n".join(lines))  # an error is one line: what was found goes before it
        raise MillfrfError(said) from error
    finally:
        named.rename(unfinished)


def update_robot_file(robot: str, paths: Sequence[Path], out: Path, report: Path | None, asking: Asking) -> list[str]:
    """Update a robot's file by measurements; lines that sum it up.

    Raises
    ------
    InputError
        Files that cannot be used together.
    MillfrfError
        Nothing explains what was measured, so that no robot file is written; the report is.
    """
    check_output(out, (".toml",), paths)
    if out.exists() and Path(robot).exists() and out.samefile(robot):
        raise InputError(f"--out {out} is the robot's own file; give another name, and compare the two")
    if report is not None:
        check_output(report, (".json",), paths)
    case = spatial(read_robot(robot))
    measured = read_measured(case, paths, asking)
    with bar("updating"):
        found = update_robot(case.robot, measured, case.poses)
    tell(lambda: {"update": as_json(found)})
    lines = summary(found, case.robot.mechanism)
    made = origin("robot update", [robot, *paths], asdict(asking))
    if report is not None:
        with writing_whole_file(report) as temporary:
            temporary.write_text(json.dumps(as_json(found), indent=1), encoding="utf-8")
        add_to_json(report, made)
        lines.append(f"wrote {report}")
    if found.verdict == "unexplained":
        say("\n".join(lines))
        raise MillfrfError(f"{out} was not written: no update of these numbers holds elsewhere")
    with writing_whole_file(out) as temporary:
        temporary.write_text(updated_document(numbered_robot_text(robot), case.robot, found), encoding="utf-8")
        add_comment(temporary, made)
        _check_readable(temporary, out, lines)
    return [*lines, f"wrote {out}: the robot's file with {len(found.parameters)} numbers updated and their covariance"]
