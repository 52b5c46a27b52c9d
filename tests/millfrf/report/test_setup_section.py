"""Set-up of the recordings: what all state alike stands once, the rest by recording."""

from pathlib import Path

import numpy as np

import millfrf as mf
from millfrf.reports.collection import collect
from millfrf.reports.sections.measurement import setup_section


def _recording(path: Path, teeth: int, title: str = "a cut") -> Path:
    signals = {"fx": np.sin(np.arange(200.0)), "ax": np.cos(np.arange(200.0))}
    setup = f'[cutting]\nteeth = {teeth}\nmaterial = "steel"\n'
    made = mf.Recording.from_arrays(
        signals, 100.0, {"fx": "N TCP:+X", "ax": "m/s^2 TCP:+X"}, title=title, setup=setup, recorded_at="2026-01-01"
    )
    made.save(path)
    return path


def test_what_all_recordings_state_stands_once(tmp_path: Path) -> None:
    paths = [_recording(tmp_path / f"cut_{teeth}.h5", teeth) for teeth in (2, 3)]
    alike, differing = setup_section(collect(paths)).tables
    assert alike.columns == ("", "all recordings")
    assert dict(alike.rows) == {"recorded at": "2026-01-01", "title": "a cut", "cutting: material": "steel"}
    assert differing.columns == ("", "cut_2", "cut_3")
    assert differing.rows == (("cutting: teeth", "2", "3"),)


def test_one_recording_needs_one_table(tmp_path: Path) -> None:
    [table] = setup_section(collect([_recording(tmp_path / "cut.h5", 2)])).tables
    assert table.columns == ("", "cut")
    assert ("cutting: teeth", "2") in table.rows
