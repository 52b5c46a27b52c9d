"""`OpenedCampaign`: a campaign's file read, its recordings found, its tasks planned and keyed."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from millfrf.core import InputError, checked_toml

from ...progress import Progress
from ..configuration import (
    CampaignFile,
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
from ..graph import Plan, Task, keys_of, plan_campaign
from ..running import Order, program_digest
from .postures import PostureReader


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


def open_campaign(path: Path, out: Path, progress: Progress, *, hashing: bool) -> OpenedCampaign:
    """Read, find, plan and key.

    Parameters
    ----------
    path
        The campaign's file.
    out
        Folder of results.
    progress
        Shows progress, such as ``millfrf.progress.bar``.
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
    found = find_recordings(file, base, out, kept, progress)
    looks = {place_below(one.path, base): one.look for one in found}
    if hashing:
        looks = hash_all(looks, base, progress)
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
