"""Blocks of the other pages, run as they stand; what is not run here says why."""

import runpy
import shutil
from pathlib import Path
from typing import Any

import pytest

from millfrf.command_line import run
from tests.docs.page_runner import COMMANDS, PROGRAMS, ROOT, run_page, steps

DOCS = ROOT / "docs"

ELSEWHERE = {
    "app": "tests/millfrf/app/test_routes_in_a_browser.py",
    "importing": "tests/millfrf/test_importing_page.py",
    "real_rig": "tests/millfrf/test_real_rig.py",
    "in_process_frf": "tests/millfrf/chain/test_estimators_of_recordings.py",
    "another_tool": "tests/millfrf/another_tool/test_command.py",
    "hammer_tests": "docs/tutorials/hammer_test.md",
    "campaigns": "docs/tutorials/campaign.md",
    "diagnosis": "docs/tutorials/diagnosing.md",
    "acquisition": "docs/tutorials/recording.md",
    "picking_poles": "tests/modal_fit",
    "cutting_diagnosis": "tests/millfrf/test_cut_command.py",
    "force_coefficients": "tests/millfrf/test_cut_identify.py",
    "stability": "tests/millfrf/test_turning_commands.py",
    "learning": "tests/millfrf/chain/test_learn_command.py",
    "simulated_cuts": "tests/millfrf/test_cut_simulate.py",
    "robot_update": "tests/robot_model/full_update/test_update.py",
    "robot_diagnosis": "tests/mismatch/adapters/robot/test_robot_causes.py",
    "scripts": "tests/millfrf/test_quiet_and_json.py",
}
"""Pages whose commands, with names for the reader's own files, are run there on files of those names or of others."""

NOT_HERE = {
    "devices": "what a terminal shows of a real rig",
    "repeats": "recordings of another laboratory",
}


def _blocks(page: str) -> int:
    return sum(step.kind in (*COMMANDS, *PROGRAMS) for step in steps(page))


def _text(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


ROBOT_PAGES = ("robot_files", "robot_models", "robot_postures")
RUN = ("first_ten_minutes", "python", "own_recordings", "modal_report", *ROBOT_PAGES)


def test_every_page_with_blocks_is_run_or_says_where_or_why_not() -> None:
    pages = {path.stem for path in DOCS.glob("*.md") if _blocks(path.read_text(encoding="utf-8"))}
    assert pages <= {*ELSEWHERE, *NOT_HERE, *RUN}
    assert {*ELSEWHERE, *NOT_HERE, *RUN} <= pages, "a page of the table has no block"
    assert all((ROOT / place).exists() for place in ELSEWHERE.values())


def test_the_tutorials_are_all_run() -> None:
    written = (ROOT / "tests" / "docs" / "test_tutorials.py").read_text(encoding="utf-8")
    assert all(f'"{path.stem}"' in written for path in (DOCS / "tutorials").glob("*.md"))


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the demonstration has run."""
    folder = tmp_path_factory.mktemp("demo")
    assert run(["demo", "--out", str(folder / "millfrf-demo")]) == 0
    return folder


@pytest.mark.slow
def test_first_ten_minutes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_page(_text("first_ten_minutes")) == 2
    assert (tmp_path / "millfrf-demo" / "mine.html").stat().st_size > 1e5


@pytest.mark.slow
def test_python_of_the_readme_and_of_its_page(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(demo)
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert run_page(readme[readme.index("## From Python") :] + _text("python")) == 5
    assert (demo / "lobes.png").stat().st_size > 1e4


@pytest.mark.slow
def test_own_recordings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:

    monkeypatch.chdir(tmp_path)
    runpy.run_path(str(ROOT / "examples" / "lab_files.py"))["write_lab_files"](tmp_path, 10.0)
    Path("cut_down.mat").rename("cut1.mat")
    shutil.copy(ROOT / "tests/robot_model/serial_chains/robots/ur10e.urdf", "ROBOT.urdf")
    (tmp_path / "recordings").mkdir()
    assert run(["convert", "cut_up.mat", "recordings/rec2.h5", "--map", str(ROOT / "examples/lab_cuts.toml")]) == 0
    assert run_page(_text("own_recordings")) == 3


@pytest.mark.slow
def test_modal_report(demo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from estimation import read_frf
    from modal_fit import read_modal_model

    monkeypatch.chdir(demo)
    shutil.copy(demo / "millfrf-demo" / "frf_hammer_tip.h5", "frf.h5")
    shutil.copy(demo / "millfrf-demo" / "cut.toml", "cut.toml")
    names: dict[str, Any] = {"frf": read_frf("frf.h5"), "model": read_modal_model("millfrf-demo/model_tip.json")}
    assert run_page(_text("modal_report"), names) == 4
    assert len(names["cmif"].peaks())
    assert names["shapes"].assurance.shape == (5, 5)  # three modes of the cut and two of the taps


@pytest.mark.slow
@pytest.mark.parametrize("name", ROBOT_PAGES)
def test_pages_of_robots_that_come_along(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_page(_text(name)) >= 1
