"""`OpenedCampaign`: a campaign file with its recordings and tasks; dry runs."""

import contextlib
import io
import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import InputError, checked_toml
from millfrf.core.terminal import Table
from millfrf.robot_model import SpatialCase, read_robot
from millfrf.steps.robot.postures import driven_of

from .campaign_tables import CampaignFile
from .planning import plan_campaign
from .progress import Rates, shown_time
from .recordings import (
    FileLook,
    FoundRecording,
    find_recordings,
    hash_all,
    look_at_other,
    place_below,
    read_kept,
    without_copies,
    without_wrong_postures,
)
from .running import Order, left_to_run
from .store import program_digest
from .tasks import Plan, RecordingSet, Task, keys_of

POSE = "pose"


class PostureReader:
    """Reads postures by the campaign's robot; without one degrees are turned into radians.

    Parameters
    ----------
    robot
        Name of a robot that ships, or the path of its file; None: none is stated.
    """

    def __init__(self, robot: str | None) -> None:
        self._robot = robot
        self._known: dict[str, tuple[float, ...] | None] = {}

    @cached_property
    def _case(self) -> SpatialCase | None:
        case: Any = None if self._robot is None else read_robot(self._robot)
        return case if isinstance(case, SpatialCase) else None

    def typed(self, one: RecordingSet | FoundRecording) -> str | None:
        """The posture as commands take it: degrees with commas, or a name that the robot's file knows; else None."""
        stated = one.posture_deg if isinstance(one, RecordingSet) else one.labels.posture_deg
        if stated is not None:
            text = ",".join(f"{value:.10g}" for value in stated)
            return text if len(stated) > 1 else f"{text},"
        named = (one.labels if isinstance(one, RecordingSet) else one.labels.values).get(POSE)
        return named if isinstance(named, str) and self._case is not None and self._driven(named) is not None else None

    def driven(self, one: RecordingSet) -> tuple[float, ...] | None:
        """Driven joint values, rad or m; None where the posture is not known or not of this robot."""
        typed = self.typed(one)
        if typed is None:
            return None
        if self._case is None:
            assert one.posture_deg is not None
            return tuple(float(value) for value in np.radians(one.posture_deg))
        return self._driven(typed)

    def _driven(self, text: str) -> tuple[float, ...] | None:
        if text not in self._known:
            try:
                with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
                    assert self._case is not None
                    self._known[text] = tuple(float(value) for value in driven_of(self._case, text))
            except InputError:
                self._known[text] = None
        return self._known[text]


@dataclass(frozen=True)
class OpenedCampaign:
    """A campaign that is ready to run.

    Parameters
    ----------
    file
        Its file as it was read.
    base, out
        Folder of the file, and that of results.
    recordings
        Recordings that were found, by name.
    plan
        Tasks, and the sets of recordings.
    looks
        Size, time of change and hash of each file, by path.
    keys
        Key of each task; None where a hash is not known.
    postures
        Postures of sets and recordings.
    robot
        Name of a robot that ships, or the path of its file, or None.
    """

    file: CampaignFile
    base: Path
    out: Path
    recordings: tuple[FoundRecording, ...]
    plan: Plan
    looks: dict[str, FileLook]
    keys: dict[str, str | None]
    postures: PostureReader
    robot: str | None

    def order(self, identity: str) -> Order:
        """The order of a planned task for a worker."""
        return self.order_of(self.plan.tasks[identity], self.keys)

    def order_of(self, task: Task, keys: Mapping[str, str | None]) -> Order:
        """The order of any task whose key, and those of its needs, are known."""
        looks = self.looks
        files = tuple((one, looks[one].size, looks[one].changed // 10**9, looks[one].digest) for one in task.files)
        needs = tuple((need, keys[need] or "") for need in task.needs)
        key, settings = keys[task.identity], json.dumps(dict(task.settings))
        assert key is not None
        return Order(task.identity, key, files, needs, settings, str(self.base), str(self.out), program_digest())

    def megabytes(self, task: Task) -> float:
        """Size of the files that a task reads."""
        return sum(max(self.looks[path].size, 0) for path in task.files) / 1e6

    @property
    def kept(self) -> dict[str, FileLook]:
        """What was seen of each file, by its place below the campaign's folder."""
        return {place_below(Path(path), self.base): look for path, look in self.looks.items()}


def open_campaign(path: Path, out: Path, *, hashing: bool) -> OpenedCampaign:
    """Read, find, plan and key.

    Parameters
    ----------
    path
        The campaign's file.
    out
        Folder of results.
    hashing
        Whether content that is not known yet is hashed; else keys that hang on it are left open.

    Raises
    ------
    InputError
        Whatever is wrong with the file or with what it names.
    """
    file = checked_toml(path, CampaignFile, "campaign")
    base = path.parent.resolve()
    kept = read_kept(out)
    found = find_recordings(file, base, out, kept)
    looks = {place_below(one.path, base): one.look for one in found}
    if hashing:
        looks = hash_all(looks, base)
    digests = {one.name: looks[place_below(one.path, base)].digest for one in found}
    recordings = tuple(without_wrong_postures(without_copies(found, digests)))
    robot = _robot(file, base)
    postures = PostureReader(robot)
    plan = plan_campaign(file, base, recordings, robot, postures.typed)
    by_path = {str(one.path): looks[place_below(one.path, base)] for one in recordings}
    for task in plan.tasks.values():
        for name in task.files:
            if name not in by_path:
                by_path[name] = look_at_other(Path(name), kept, base)
    keys = keys_of(plan.tasks, {name: look.digest for name, look in by_path.items()}, program_digest())
    return OpenedCampaign(file, base, out, recordings, plan, by_path, keys, postures, robot)


def _robot(file: CampaignFile, base: Path) -> str | None:
    """The path of a robot's file that lies with the campaign; else the name as it stands.

    Raises
    ------
    InputError
        It looks like a file, and there is none.
    """
    named = file.campaign.robot
    if named is None:
        return None
    if (base / named).is_file():
        return str(base / named)
    if Path(named).suffix:
        raise InputError(f"no robot file {named} in {base}; correct robot in [campaign]")
    return named


def graph_table(opened: OpenedCampaign, settled: Mapping[str, str], rates: Rates) -> Table:
    """A row for each kind of task: how many, how many are in the store, what it needs, and its time."""
    tasks = opened.plan.tasks
    left = set(left_to_run(tasks, settled))
    kinds = Counter(task.kind for task in tasks.values())
    needs: dict[str, set[str]] = {kind: set() for kind in kinds}
    seconds = dict.fromkeys(kinds, 0.0)
    for identity, task in tasks.items():
        needs[task.kind].update(need.partition(":")[0] for need in task.needs)
        if identity in left:
            seconds[task.kind] += rates.seconds(task, opened.megabytes(task))
    rows = [
        (
            kind,
            str(count),
            str(sum(task.kind == kind and identity in settled for identity, task in tasks.items())),
            ", ".join(sorted(needs[kind])) or "files",
            shown_time(seconds[kind]),
            "measured here" if kind in rates.measured else "default",
        )
        for kind, count in kinds.items()
    ]
    columns = ("task", "number", "in the store", "needs", "time left, one core", "rate")
    return Table(f"Graph of {opened.file.campaign.title}", columns, tuple(rows))


def time_lines(opened: OpenedCampaign, settled: Mapping[str, str], rates: Rates, workers: int) -> list[str]:
    """Number of tasks, how long they take together and on so many workers, and what is not known."""
    tasks = opened.plan.tasks
    left = left_to_run(tasks, settled)
    each = {identity: rates.seconds(tasks[identity], opened.megabytes(tasks[identity])) for identity in left}
    total, chain = sum(each.values()), longest_chain(tasks, each)
    lines = [
        f"{len(opened.recordings)} recordings, {len(opened.plan.sets)} sets, {len(tasks)} tasks and the report; "
        f"{len(left)} to run",
        f"about {shown_time(max(total / workers, chain))} on {workers} worker{'s' if workers != 1 else ''} "
        f"({shown_time(total)} on one; the longest chain of tasks takes {shown_time(chain)})",
    ]
    guessed = sorted({tasks[one].kind for one in left} - rates.measured)
    if guessed and left:
        lines.append(
            f"default rates, which may be off by a factor of 5, for {', '.join(guessed)}; a run of this campaign "
            "measures its own"
        )
    unknown = sum(not look.digest for look in opened.looks.values())
    if unknown:
        lines.append(f"{unknown} files are new or changed since they were hashed: their tasks count as not done")
    return lines


def longest_chain(tasks: Mapping[str, Task], seconds: Mapping[str, float]) -> float:
    """Time of the longest chain of tasks each of which needs the one before, s."""
    until: dict[str, float] = {}
    for identity, task in tasks.items():
        until[identity] = seconds.get(identity, 0.0) + max((until[need] for need in task.needs), default=0.0)
    return max(until.values(), default=0.0)
