"""The job `report`: the table of modes, the maps and the report over all sets."""

from pathlib import Path
from typing import Any

from ..results import MeasuredSet, write_summary
from .diagnose import DIAGNOSIS
from .fit import MODEL
from .lobes import LOBES
from .robot_jobs import LEARNED
from .work import Outcome, Work

FILE_OF = {"model": MODEL, "lobes": LOBES, "diagnosis": DIAGNOSIS}
"""File of each result that the report reads."""


def report(work: Work, folder: Path) -> list[str]:
    """Summary of the campaign.

    Raises
    ------
    InputError
        A library that it needs is missing.
    """
    asked = work.settings
    outcomes = {one.identity: one for one in work.needs}
    learned = outcomes.get(asked["learned"])
    write_summary(
        folder,
        asked["title"],
        [_measured(one, outcomes) for one in asked["sets"]],
        robot=str(work.files[0]) if work.files else asked["robot"],
        learned=learned.folder / LEARNED if learned is not None and learned.done else None,
        failures=asked["failures"],
    )
    return []


def _measured(stored: dict[str, Any], outcomes: dict[str, Outcome]) -> MeasuredSet:
    """A set as it stands in the settings, with the files of its results."""
    found = {
        result: outcomes[identity].folder / FILE_OF[result]
        for result, identity in stored["results"].items()
        if result in FILE_OF and identity in outcomes and outcomes[identity].done
    }
    posture = stored["posture"]
    return MeasuredSet(
        stored["name"],
        stored["labels"],
        None if posture is None else tuple(posture),
        stored["recorded_at"],
        tuple(stored["recordings"]),
        found.get("model"),
        found.get("lobes"),
        found.get("diagnosis"),
        tuple(stored["failures"]),
    )
