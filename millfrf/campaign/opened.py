"""A campaign file with its recordings and tasks, and the tables of a dry run."""

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
from millfrf.core.content_hashes import EDITED, accepts_edited
from millfrf.core.provenance import content_state
from millfrf.core.terminal import Table
from millfrf.robot_model import SpatialCase, read_robot
from millfrf.steps.robot.postures import driven_of

from .campaign_tables import CampaignFile
from .planning import plan_campaign
from .progress import Rates, shown_time
from .recordings import (
    POSE,
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


class PostureReader:
    """Convert postures with the robot of the campaign; without a robot, degrees to radians."""

    def __init__(self, robot: str | None) -> None:
        self._robot = robot
        self._known: dict[str, tuple[float, ...] | None] = {}

    @cached_property
    def _case(self) -> SpatialCase | None:
        case: Any = None if self._robot is None else read_robot(self._robot)
        return case if isinstance(case, SpatialCase) else None

    def typed(self, item: RecordingSet | FoundRecording) -> str | None:
        """Return the posture as commands take it: degrees with commas, or a name in the robot file."""
        posture_deg = item.posture_deg if isinstance(item, RecordingSet) else item.labels.posture_deg
        if posture_deg is not None:
            text = ",".join(f"{value:.10g}" for value in posture_deg)
            return text if len(posture_deg) > 1 else f"{text},"
        pose = (item.labels if isinstance(item, RecordingSet) else item.labels.values).get(POSE)
        return pose if isinstance(pose, str) and self._case is not None and self._driven(pose) is not None else None

    def driven(self, recording_set: RecordingSet) -> tuple[float, ...] | None:
        """Return driven joint values, rad or m; None if the posture is unknown or does not fit the robot."""
        typed = self.typed(recording_set)
        if typed is None:
            return None
        if self._case is None:
            assert recording_set.posture_deg is not None
            return tuple(float(value) for value in np.radians(recording_set.posture_deg))
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
    """A campaign with planned tasks and their keys."""

    file: CampaignFile
    base: Path  # folder of the campaign file
    out: Path  # folder of results
    recordings: tuple[FoundRecording, ...]
    plan: Plan
    looks: dict[str, FileLook]  # by path
    keys: dict[str, str | None]  # by task; None: the hash of an input is not known
    postures: PostureReader
    robot: str | None  # name of a built-in robot, or path of a robot file

    def order(self, identity: str) -> Order:
        return self.order_of(self.plan.tasks[identity], self.keys)

    def order_of(self, task: Task, keys: Mapping[str, str | None]) -> Order:
        """Return the message to a worker about a task; the keys of the task and of its inputs must be known."""
        looks = self.looks
        files = tuple((path, looks[path].size, looks[path].changed // 10**9, looks[path].digest) for path in task.files)
        needs = tuple((need, keys[need] or "") for need in task.needs)
        key, settings = keys[task.identity], json.dumps(dict(task.settings))
        assert key is not None
        places, edited = (str(self.base), str(self.out)), accepts_edited()
        return Order(task.identity, key, files, needs, settings, *places, program_digest(), edited)

    def megabytes(self, task: Task) -> float:
        """Return the size of the files that a task reads."""
        return sum(max(self.looks[path].size, 0) for path in task.files) / 1e6

    @property
    def kept(self) -> dict[str, FileLook]:
        """Return size, time of change and hash of each file, by its path relative to the folder of the campaign."""
        return {place_below(Path(path), self.base): look for path, look in self.looks.items()}


def open_campaign(path: Path, out: Path, *, hashing: bool) -> OpenedCampaign:
    """Read the file, find the recordings, plan the tasks and compute their keys."""
    file = checked_toml(path, CampaignFile, "campaign")
    base = path.parent.resolve()
    cached = read_kept(out)
    recordings_found = find_recordings(file, base, out, cached)
    looks = {place_below(recording.path, base): recording.look for recording in recordings_found}
    if hashing:
        looks = hash_all(looks, base)
    digests = {recording.name: looks[place_below(recording.path, base)].digest for recording in recordings_found}
    recordings = tuple(without_wrong_postures(without_copies(recordings_found, digests)))
    robot = _robot(file, base)
    postures = PostureReader(robot)
    plan = plan_campaign(file, base, recordings, robot, postures.typed)
    by_path = {str(recording.path): looks[place_below(recording.path, base)] for recording in recordings}
    for task in plan.tasks.values():
        for name in task.files:
            if name not in by_path:
                by_path[name] = look_at_other(Path(name), cached, base)
    keys = keys_of(plan.tasks, {name: _accepted(name, look) for name, look in by_path.items()}, program_digest())
    return OpenedCampaign(file, base, out, recordings, plan, by_path, keys, postures, robot)


def _accepted(name: str, look: FileLook) -> str:
    """Return the hash of a file for keys; that of an accepted edited file differs, because its refusal is stored."""
    is_accepted = accepts_edited() and content_state(name) == EDITED
    return f"{look.digest} accepted as edited" if is_accepted and look.digest else look.digest


def _robot(file: CampaignFile, base: Path) -> str | None:
    """Return the path of a robot file in the folder of the campaign, else the name unchanged."""
    name = file.campaign.robot
    if name is None:
        return None
    if (base / name).is_file():
        return str(base / name)
    if Path(name).suffix:
        raise InputError(f"no robot file {name} in {base}; correct robot in [campaign]")
    return name


def graph_table(opened: OpenedCampaign, settled: Mapping[str, str], rates: Rates) -> Table:
    """Return one row for each kind of task: number, number stored, needs, and expected time."""
    tasks = opened.plan.tasks
    open_tasks = set(left_to_run(tasks, settled))
    kinds = Counter(task.kind for task in tasks.values())
    needs: dict[str, set[str]] = {kind: set() for kind in kinds}
    seconds = dict.fromkeys(kinds, 0.0)
    for identity, task in tasks.items():
        needs[task.kind].update(need.partition(":")[0] for need in task.needs)
        if identity in open_tasks:
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
    """Describe the number of tasks, their total time, their time on ``workers`` workers, and kinds of unknown time."""
    tasks = opened.plan.tasks
    open_tasks = left_to_run(tasks, settled)
    seconds = {identity: rates.seconds(tasks[identity], opened.megabytes(tasks[identity])) for identity in open_tasks}
    total, chain = sum(seconds.values()), longest_chain(tasks, seconds)
    lines = [
        f"{len(opened.recordings)} recordings, {len(opened.plan.sets)} sets, {len(tasks)} tasks and the report; "
        f"{len(open_tasks)} to run",
        f"about {shown_time(max(total / workers, chain))} on {workers} worker{'s' if workers != 1 else ''} "
        f"({shown_time(total)} on one; the longest chain of tasks takes {shown_time(chain)})",
    ]
    defaults = sorted({tasks[identity].kind for identity in open_tasks} - rates.measured)
    if defaults and open_tasks:
        lines.append(
            f"default rates, which may be wrong by a factor of 5, for {', '.join(defaults)}; a run of this campaign "
            "measures them"
        )
    unknown = sum(not look.digest for look in opened.looks.values())
    if unknown:
        lines.append(f"{unknown} files are new or changed since they were hashed: their tasks count as not done")
    return lines


def longest_chain(tasks: Mapping[str, Task], seconds: Mapping[str, float]) -> float:
    """Return the time (s) of the longest chain of dependent tasks; a run takes at least this time."""
    until: dict[str, float] = {}
    for identity, task in tasks.items():
        until[identity] = seconds.get(identity, 0.0) + max((until[need] for need in task.needs), default=0.0)
    return max(until.values(), default=0.0)
