"""An option is described once: one line more in a step's signature is found in every place that shows options."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ROOMS = ("acquisition", "estimation", "modal_fit", "replay_data", "millfrf")
LINE = "    smoothing: Annotated[float, Ge(0), Le(9)] = 0.25,\n"
WORDS = "    smoothing : Hz\n        Width of a smoothing that no version of this program has.\n"


@pytest.fixture(scope="module")
def changed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the program in which ``estimate`` has one option more."""
    root = tmp_path_factory.mktemp("changed")
    for room in ROOMS:
        shutil.copytree(ROOT / room, root / room, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(ROOT / "docs" / "extensions", root / "extensions")
    step = root / "millfrf" / "steps" / "estimate.py"
    text = step.read_text(encoding="utf-8")
    head, signature = text.split("\ndef estimate(", 1)
    parameters, body = signature.split("\n) ->", 1)
    docstring, rest = body.split("\n    Returns\n", 1)
    step.write_text(
        f"from annotated_types import Ge, Le\n{head}\ndef estimate({parameters}\n{LINE}) ->"
        f"{docstring.rstrip()}\n{WORDS}\n    Returns\n{rest}",
        encoding="utf-8",
    )
    return root


def _run(root: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=root,
        capture_output=True,
        text=True,
        env={"PYTHONPATH": f"{root}{os.pathsep}{root / 'extensions'}"},
        check=False,
    )


def test_the_command_has_it_with_its_bounds(changed: Path) -> None:
    shown = _run(changed, "-m", "millfrf", "estimate", "--help").stdout
    assert "--smoothing NUMBER" in shown
    assert "Width of a smoothing that no version of this program has. [Hz] [default: 0.25]" in " ".join(shown.split())
    refused = _run(changed, "-m", "millfrf", "estimate", "a.h5", "--smoothing", "10", "--out", "b.h5")
    assert refused.returncode == 2
    assert refused.stderr.startswith("millfrf: --smoothing 10 Hz: give a number at most 9 Hz")


def test_the_campaign_and_its_schema_have_it(changed: Path) -> None:
    assert _run(changed, "-m", "millfrf", "new", "schemas", "--out", "schemas").returncode == 0
    schema = json.loads((changed / "schemas" / "campaign.schema.json").read_text(encoding="utf-8"))
    [table] = [each for name, each in schema["$defs"].items() if name.startswith("Estimate")]
    assert table["properties"]["smoothing_hz"]["default"] == 0.25
    assert table["properties"]["smoothing_hz"]["maximum"] == 9
    assert "no version of this program" in table["properties"]["smoothing_hz"]["description"]


def test_the_reference_has_it(changed: Path) -> None:
    code = "from command_pages import command_page; print(command_page('estimate'))"
    page = _run(changed, "-c", code).stdout
    assert "| `--smoothing` | `NUMBER` | `0.25` | Width of a smoothing" in page


def test_python_has_it(changed: Path) -> None:
    code = "import inspect, millfrf as mf; print(inspect.signature(mf.estimate).parameters['smoothing'].default)"
    assert _run(changed, "-c", code).stdout == "0.25\n"
