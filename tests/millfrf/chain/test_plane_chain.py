"""From another laboratory's 222 FRFs to a report: the commands of docs/importing.md, the modes, every FRF, the size."""

import base64
import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import run
from modal_fit import read_modal_model

PAGE = (Path(__file__).parents[3] / "docs" / "importing.md").read_text(encoding="utf-8")
PLANE = np.array(
    [18.837, 40.133, 87.737, 89.673, 97.533, 105.185, 117.880, 125.186, 125.659, 130.032, 135.100, 143.173, 166.223]
)
"""Hz, of the laboratory itself; see SOURCE.md of the data."""


@pytest.mark.long
@pytest.mark.shared_data
def test_the_plane_goes_from_arrays_to_a_report_in_few_commands(
    shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copy(shared_data / "plane-hammer" / "plane.npz", "plane.npz")
    [mapping] = re.findall(r"```toml\n(# plane\.toml\n.*?)```", PAGE, re.DOTALL)
    Path("plane.toml").write_text(mapping, encoding="utf-8")
    [block] = re.findall(r"```sh\n(millfrf convert plane\.npz.*?)```", PAGE, re.DOTALL)
    commands = [shlex.split(line)[1:] for line in block.splitlines()]
    assert len(commands) <= 5
    for command in commands:
        assert run(command) == 0, (command, capsys.readouterr().err)
    result = read_modal_model("model.json").natural_frequencies
    assert len(result) == 13
    np.testing.assert_allclose(result, PLANE, rtol=5e-3)
    _every_frf_is_drawn(Path("report.html"))


def _every_frf_is_drawn(path: Path) -> None:
    assert path.stat().st_size < 10e6
    page = path.read_text(encoding="utf-8")
    images = re.findall(r"data:image/svg\+xml;base64,([A-Za-z0-9+/=]+)", page)
    titles: list[str] = []
    misfits: list[str] = []
    for image in images:
        svg = base64.b64decode(image).decode()
        titles += re.findall(r">([ABC]:\+Z / \d+:\+[XZ])</text>", svg)
        misfits += re.findall(r">([\d.]+) %</text>", svg)
    assert len(titles) == len(set(titles)) == len(misfits) == 222
    assert sorted(misfits, key=float, reverse=True) == misfits  # the worst first
    ranked = re.findall(r'<th scope="row" class="n">(\d+)</th><td>([ABC]:\+Z / \d+:\+[XZ])</td>', page)
    assert [name for _, name in ranked[-222:]] == titles
