"""Typical mistakes of a laboratory: each ends in one clear line, or in a warning that reaches the report."""

import hashlib
import html
import re
import shlex
import shutil
from pathlib import Path

import pytest
import spoiling
from the_table import Mistake, mistakes

from millfrf.command_line import BAD_INPUT, DONE, FAILED, run

TABLE = mistakes()
FOREIGN = re.compile(
    r"pydantic|numpy|scipy|h5py|Traceback|Error\b|Errno|unexpected |MILLFRF_TRACEBACK|Input should|"
    r"Value error|singular matrix|could not convert|invalid literal|NoneType|\bfloat\(\)|\bdtype\b|\bnp\.",
)
"""Words of the libraries underneath, which no user shall meet."""


@pytest.fixture
def bench(good: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the good files, and the working folder."""
    folder = tmp_path / "bench"
    shutil.copytree(good, folder)
    monkeypatch.chdir(folder)
    return folder


def _state(folder: Path) -> dict[str, str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def spoilt(row: Mistake, folder: Path) -> None:
    """Do what the row says was done."""
    for name, *words in row.spoil:
        getattr(spoiling, name)(folder, *words)


@pytest.mark.parametrize("row", TABLE, ids=[row.name for row in TABLE])
def test_a_mistake_ends_in_a_clear_line(row: Mistake, bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spoilt(row, bench)
    before = _state(bench)
    capsys.readouterr()
    code = run(shlex.split(row.command))
    said = capsys.readouterr()
    line = said_line(row, code, said.out, said.err)
    assert not FOREIGN.search(line), line
    for wanted in row.says:
        assert re.search(wanted, line, re.IGNORECASE), (wanted, line)
    if code != DONE:
        assert _state(bench) == before
        return
    if row.report:
        assert run(["report", *row.report.split(), "--out", "report_of_it.html"]) == DONE
    page = row.page or ("report_of_it.html" if row.report else "")
    if page:
        assert _plain(line.removeprefix("warning: ")) in _plain(_words(bench / page))


def said_line(row: Mistake, code: int, out: str, err: str) -> str:
    """The line by which the row's mistake is told."""
    if row.ends == "refused" or (row.ends == "either" and code != DONE):
        assert code == BAD_INPUT, (code, out, err)
        assert err.startswith("millfrf: "), err
        assert err.count("\n") == 1, err
        assert len(err) < 600, err
        return err.strip()
    if row.ends == "failed":
        assert code == FAILED, (code, out, err)
        lines = err.splitlines()
        assert all(line.startswith("warning: ") for line in lines[:-1]), err
        assert lines[-1].startswith("millfrf: "), err
        return lines[-1]
    assert code == DONE, (code, err)
    stated = out + err if row.command.startswith("inspect") else err
    warnings = [line for line in stated.splitlines() if line.startswith("warning: ")]
    assert warnings, (out, err)
    right = [line for line in warnings if all(re.search(wanted, line, re.IGNORECASE) for wanted in row.says)]
    assert right, (row.says, warnings)
    return right[0]


def _words(page: Path) -> str:
    """The text of a page without its marks."""
    return html.unescape(re.sub(r"<[^>]+>", " ", page.read_text(encoding="utf-8")))


def _plain(text: str) -> str:
    return " ".join(text.split())
