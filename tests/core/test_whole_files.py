"""Files and folders appear whole or not at all."""

import os
import shutil
import sys
import time
import warnings
from pathlib import Path

import pytest

from millfrf.core import DiskError, DiskFull, InputError, LeftoverRemoved, writing_whole_file, writing_whole_folder


def test_a_failure_leaves_the_old_file_and_no_litter(tmp_path: Path) -> None:
    target = tmp_path / "result.json"
    target.write_text("old")

    def fail_half_way() -> None:
        with writing_whole_file(target) as temporary:
            temporary.write_text("half")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        fail_half_way()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_missing_folder_is_named_with_the_remedy(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="does not exist; create it"), writing_whole_file(tmp_path / "no" / "a.csv"):
        pass


def test_a_folder_appears_with_all_its_files_and_replaces_only_those(tmp_path: Path) -> None:
    with writing_whole_folder(tmp_path / "out") as folder:
        (folder / "a.txt").write_text("one")
        (folder / "deeper").mkdir()
        (folder / "deeper" / "b.txt").write_text("two")
        assert not (tmp_path / "out").exists()
    (tmp_path / "out" / "kept.txt").write_text("mine")
    with writing_whole_folder(tmp_path / "out") as folder:
        (folder / "deeper").mkdir()
        (folder / "deeper" / "b.txt").write_text("three")
        assert (tmp_path / "out" / "deeper" / "b.txt").read_text() == "two"
    texts = {str(f.relative_to(tmp_path)): f.read_text() for f in tmp_path.rglob("*") if f.is_file()}
    assert texts == {"out/a.txt": "one", "out/deeper/b.txt": "three", "out/kept.txt": "mine"}


def test_a_failure_leaves_no_folder(tmp_path: Path) -> None:
    def fail_half_way() -> None:
        with writing_whole_folder(tmp_path / "out") as folder:
            (folder / "a.txt").write_text("one")
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError, match="power cut"):
        fail_half_way()
    assert list(tmp_path.iterdir()) == []


def test_what_a_link_points_to_is_replaced_and_a_device_is_refused(tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    link = tmp_path / "a.txt"
    link.symlink_to(tmp_path / "there" / "b.txt")
    with writing_whole_file(link) as temporary:
        temporary.write_text("whole")
    assert link.is_symlink()
    assert (tmp_path / "there" / "b.txt").read_text() == "whole"
    with pytest.raises(InputError, match="is a device"), writing_whole_file(os.devnull):
        pass


@pytest.mark.skipif(sys.platform != "linux", reason="descriptors are named as Linux does")
def test_a_file_is_synced_before_it_gets_its_name_and_the_folder_after(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A power failure behind the rename must not leave a name without its bytes, nor lose the name."""
    done: list[str] = []
    sync, replace = os.fsync, Path.replace

    def noted_sync(descriptor: int) -> None:
        done.append(f"sync {Path(f'/proc/self/fd/{descriptor}').readlink().name}")
        sync(descriptor)

    def noted_replace(self: Path, target: Path) -> Path:
        done.append(f"rename {target.name}")
        return replace(self, target)

    monkeypatch.setattr(os, "fsync", noted_sync)
    monkeypatch.setattr(Path, "replace", noted_replace)
    with writing_whole_file(tmp_path / "a.txt") as temporary:
        temporary.write_text("whole")
    assert done == ["sync a.txt", "rename a.txt", f"sync {tmp_path.name}"]


def _begun(folder: Path) -> Path:
    """What a writer leaves that is killed in the middle: nobody holds its lock."""
    with writing_whole_file(folder / "a.h5") as temporary:
        temporary.write_text("half")
        shutil.copytree(temporary.parent, folder / "copy")
    (folder / "a.h5").unlink()
    return (folder / "copy").rename(folder / ".millfrf-killed00.unfinished")


def test_a_dead_writers_files_are_removed_and_a_living_ones_are_kept(tmp_path: Path) -> None:
    with writing_whole_file(tmp_path / "living.txt") as living:
        living.write_text("half")
        dead = _begun(tmp_path)
        said = pytest.warns(LeftoverRemoved, match="unfinished a.h5 of a run that was killed")
        with said, writing_whole_file(tmp_path / "next.txt") as temporary:
            temporary.write_text("whole")
        assert not dead.exists()
        assert living.read_text() == "half"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["living.txt", "next.txt"]


def test_an_unfinished_folder_without_a_lock_is_left_alone_for_an_hour(tmp_path: Path) -> None:
    young = _begun(tmp_path)
    (young / "writer").unlink()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with writing_whole_file(tmp_path / "next.txt") as temporary:
            temporary.write_text("whole")
    assert young.exists()
    os.utime(young, (time.time() - 4000, time.time() - 4000))
    with pytest.warns(LeftoverRemoved), writing_whole_file(tmp_path / "next.txt") as temporary:
        temporary.write_text("whole")
    assert not young.exists()


def test_a_full_disk_is_named_whichever_library_meets_it(tmp_path: Path) -> None:
    def meet(error: Exception) -> None:
        with writing_whole_file(tmp_path / "a.h5"):
            raise error

    for error in (OSError(28, "No space left on device"), RuntimeError("write failed: errno = 122, quota")):
        with pytest.raises(DiskFull, match=r"no room for .*a\.h5: its disk or quota is full"):
            meet(error)
    for error in (OSError(5, "Input/output error"), RuntimeError("write failed: errno = 5, error message")):
        with pytest.raises(
            DiskError, match=r"the disk of .*a\.h5 failed \(Input/output error\); the file was not written"
        ):
            meet(error)
    with pytest.raises(OSError, match="Connection refused"):
        meet(ConnectionRefusedError(111, "Connection refused"))
    assert list(tmp_path.iterdir()) == []
