"""Names of channels that look like rich's markup: every command shows them as they stand."""

import re
from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, Recording, RecordingWriter, StreamDescription
from millfrf.command_line import run
from millfrf.core.progress import progress
from millfrf.core.terminal import Table, grouped, say, show, speaking, warn

ROOT = Path(__file__).resolve().parents[2]
NAMES = ("acc x [g]", "[/]", "[red]x", "[link=http://a.example]y", ":bomb:", "z\x1b[2Jz")
SHOWN = (*NAMES[:5], "z\N{REPLACEMENT CHARACTER}[2Jz")
RATE = 2048.0


def _written(path: Path, force: np.ndarray) -> Path:
    """A recording of a force and of what one mode answers; every channel has a name that is markup or worse."""
    channel = Channel("f [N]", "force", "N", "TCP", "+X", full_scale=500.0)
    motions = [Channel(name, "acceleration", "m/s^2", f"P{k}", "+X", full_scale=500.0) for k, name in enumerate(NAMES)]
    time = np.arange(2048) / RATE
    motion = np.convolve(force, np.exp(-2 * np.pi * time) * np.sin(2 * np.pi * 100 * time))[: len(force)] / 30
    noise = np.random.default_rng(0).standard_normal((len(force), 1 + len(NAMES))) * 0.01
    streams = (StreamDescription("main", RATE, 0.0, (channel, *motions)),)
    with RecordingWriter(path, streams, title="[/] [i]cut") as file:
        file.append("main", np.column_stack([force, *[motion] * len(NAMES)]) + noise)
    return path


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Three taps."""
    time = np.arange(int(6 * RATE)) / RATE
    struck = np.sum([300 * np.exp(-0.5 * ((time - at) / 1e-3) ** 2) for at in (0.5, 2.5, 4.5)], axis=0)
    return _written(tmp_path / "[bold]rec[red].h5", struck)


def test_inspect_shows_names_as_they_stand(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["inspect", str(recording)]) == 0
    said = capsys.readouterr().out
    assert "[bold]rec[red].h5: recording, [/] [i]cut" in said
    assert [name for name in SHOWN if name not in said] == []
    assert "\x1b" not in said


def test_no_command_stumbles_over_such_names(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = recording.parent
    band = ["--band", "60,140"]
    assert run(["tap", str(recording), "--out", str(out / "[red]t.h5")]) == 0
    milled = str(_written(out / "[red]milled.h5", 50 * np.random.default_rng(1).standard_normal(int(20 * RATE))))
    assert run(["estimate", milled, "--segment", "1", "--out", str(out / "[red]e.h5")]) == 0
    assert run(["inspect", str(out / "[red]e.h5")]) == 0
    assert run(["fit", str(out / "[red]t.h5"), *band, "--out", str(out / "[red]m.json")]) == 0
    assert run(["inspect", str(out / "[red]m.json")]) == 0
    assert run(["convert", str(recording), str(out / "[red]c.npz")]) == 0
    assert run(["recover", str(recording), "--out", str(out / "[red]r.h5")]) in (0, 2)
    assert run(["acquire", _replayed(recording), "--check", "--seconds", "3"]) in (0, 1)
    assert run(["acquire", _replayed(recording), "--out", str(out / "[red]a.h5")]) == 0
    with Recording(out / "[red]a.h5") as again:
        assert tuple(channel.name for channel in again.stream().channels)[1:] == NAMES
    said = capsys.readouterr()
    assert "does not foresee" not in said.err
    assert "[red]e.h5" in said.out
    assert "\x1b" not in said.out + said.err


def _replayed(recording: Path) -> str:
    session = recording.with_name("session.toml")
    session.write_text(f'[device]\ndriver = "replay"\nfile = "{recording.name}"\nspeed = 100.0\n')
    return str(session)


def test_a_bar_shows_its_description_as_it_stands(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr("millfrf.core.progress.QUIET_FOR", -1.0)
    with speaking(), progress("reading [/] [red]x\x1b[2J", 10) as update:
        update(5)
    painted = capsys.readouterr().err
    assert "reading [/] [red]x\N{REPLACEMENT CHARACTER}[2J" in re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", painted)


@pytest.mark.parametrize("text", NAMES)
def test_tables_show_title_headings_and_cells(text: str, capsys: pytest.CaptureFixture[str]) -> None:
    with speaking():
        show(Table(text, ("name", text), ((text, "1"),)))
    expected = SHOWN[NAMES.index(text)]
    assert capsys.readouterr().out.count(expected) == 3


def test_nothing_else_in_the_program_prints_through_rich() -> None:
    rooms = [path for path in ROOT.iterdir() if (path / "__init__.py").is_file() and path.name != "tests"]
    users = [
        str(file.relative_to(ROOT))
        for room in rooms
        for file in room.rglob("*.py")
        if re.search(r"^\s*(from|import) rich\b", file.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    assert sorted(users) == ["millfrf/core/progress.py", "millfrf/core/terminal.py"]


def test_every_line_of_an_answer_passes_the_terminal() -> None:
    """`print` would carry a channel's control characters to the screen."""
    root = ROOT / "millfrf"
    allowed = {"core/terminal.py", "command_line.py"}
    past = [
        f"{path.relative_to(root)}:{number}"
        for path in sorted(root.rglob("*.py"))
        if path.relative_to(root).as_posix() not in allowed
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.match(r"\s*print\(", line)
    ]
    assert not past, f"print with millfrf.core.terminal.say: {past}"


def test_a_warning_goes_to_standard_error_without_control_characters(capsys: pytest.CaptureFixture[str]) -> None:
    with speaking():
        warn(["ax\x1b[2J is dead"])
        say("wrote b\r.h5")
    shown = capsys.readouterr()
    assert shown.err == "warning: ax\ufffd[2J is dead\n"
    assert shown.out == "wrote b\ufffd.h5\n"


def test_a_doubt_that_files_hand_on_is_given_once_with_its_origin() -> None:
    doubts = [
        "TCP:+X is at least 1.9 ms late",
        "tap.h5: TCP:+X is at least 1.9 ms late",  # the same, of the file that was just read
        "rec.h5: mains hum in ax1 at 50 Hz",
        "model.json: frf.h5: rec.h5: mains hum in ax1 at 50 Hz",
        "rec.h5: mains hum in ax2 at 50 Hz",  # another channel
        "other.h5: mains hum in ax1 at 60 Hz",
    ]
    assert grouped(doubts) == [
        "TCP:+X is at least 1.9 ms late",
        "rec.h5: mains hum in ax1 at 50 Hz (likewise other.h5)",
        "rec.h5: mains hum in ax2 at 50 Hz",
    ]
