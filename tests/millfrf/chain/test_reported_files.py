"""Small files made after public reports of misread exports: one table of file, command and right answer."""

import tomllib
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition import Recording
from estimation import read_frf
from millfrf.command_line import run

pytestmark = pytest.mark.shared_data

F, Z, M = np.array([30.0, 62.0]), np.array([0.03, 0.02]), np.array([12.0, 20.0])


def accelerance(frequencies: np.ndarray) -> np.ndarray:
    """Truth of every FRF among the files."""
    w, w0 = 2 * np.pi * frequencies[:, None], 2 * np.pi * F
    return (-(w**2) / (M * (w0**2 - w**2 + 2j * Z * w0 * w))).sum(axis=1)


@pytest.fixture
def reports(shared_data: Path) -> Path:
    folder = shared_data.parent / "reports"
    if not folder.is_dir():
        pytest.skip(f"the files are not at {folder}")
    return folder


def answered(reports: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str) -> tuple[int, str]:
    """Exit code of a command, and all that it said; ``R/`` is the folder of the files."""
    capsys.readouterr()
    code = run(words.replace("R/", f"{reports}/").replace("OUT", str(tmp_path / "out")).split())
    said = capsys.readouterr()
    return code, said.out + said.err


FRFS = [
    ("convert R/u01_khz.uff OUT.h5", 201, "accelerance"),
    ("convert R/u04_uneven_padded.uff OUT.h5", 201, "accelerance"),
    ("convert R/f09_rpm.csv OUT.h5 --map R/dof.toml", 401, "accelerance"),
    ("convert R/u17_transmissibility.uff OUT.h5", 201, "transfer"),
    ("convert R/f13_inf_dc.csv OUT.h5 --map R/dof.toml", 401, "receptance"),
]


@pytest.mark.parametrize(("words", "n_lines", "quantity"), FRFS)
def test_frfs_over_the_axis_that_the_file_states(
    reports: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str, n_lines: int, quantity: str
) -> None:
    code, said = answered(reports, tmp_path, capsys, words)
    assert code == 0, said
    assert "Warning" not in said
    frf = read_frf(tmp_path / "out.h5")
    assert frf.quantity == quantity
    assert len(frf.frequencies) == n_lines
    assert frf.frequencies[-1] == pytest.approx(100, rel=1e-6)
    lines = frf.valid & (frf.frequencies > 0)
    truth = accelerance(frf.frequencies[lines])
    if quantity == "receptance":
        truth = truth / -((2 * np.pi * frf.frequencies[lines]) ** 2)
    assert np.abs(frf.values[lines, 0, 0] - truth).max() < 1e-5 * np.abs(truth).max()


REFUSED = [
    ("convert R/u03_rpm.uff OUT.h5", "'RPM'", 'frequency_unit = "rpm"'),
    ("convert R/u06_real_magnitude.uff OUT.h5", "real numbers", "complex"),
    ("convert R/t01_label_g.uff OUT.h5 --map R/uff_time.toml", "acceleration in m/s^2 in the mapping", "is in g"),
    ("convert R/c25_repeated_header.csv OUT.h5", "line 1002", "not like the rows"),
    ("new mapping R/c25_repeated_header.csv --out OUT.toml", "line 1002", "not like the rows"),
    ("convert R/c38_slowdrift.csv OUT.h5", "drifts from 0.001", "4 steps off"),
    ("convert R/d06_lengths.tdms OUT.h5", "2011 of 2048", "common_length"),
]


@pytest.mark.parametrize(("words", "first", "second"), REFUSED)
def test_what_is_refused_by_name(
    reports: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: str, first: str, second: str
) -> None:
    code, said = answered(reports, tmp_path, capsys, words)
    assert code == 2
    assert first in said
    assert second in said
    assert not (tmp_path / "out.h5").exists()


def test_an_axis_in_rpm_is_read_where_the_mapping_says_what_one_is(
    reports: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "rpm.toml").write_text('[frf]\nfrequency_unit = "rpm"\n')
    words = f"convert R/u03_rpm.uff OUT.h5 --map {tmp_path / 'rpm.toml'}"
    assert answered(reports, tmp_path, capsys, words)[0] == 0
    frf = read_frf(tmp_path / "out.h5")
    assert frf.frequencies[np.abs(frf.values[:, 0, 0]).argmax()] == pytest.approx(30, abs=1)


RECORDINGS = [
    # file, samples, rate (Hz), start (s), unit of acceleration in the file, samples missing
    ("c05_comma_comma.csv", 2000, 1000.0, 0.0, "m/s^2", 0),
    ("c14_trailing_sep.csv", 2000, 1000.0, 0.0, "m/s^2", 0),
    ("c21_spaces.txt", 2000, 1000.0, 0.0, "g", 0),
    ("c16_lvm.lvm", 2000, 1000.0, 0.0, "m/s^2", 0),
    ("c11_iso.csv", 2000, 1000.0, 0.0, "m/s^2", 0),
    ("c08_gap.csv", 2000, 1000.0, 0.0, "m/s^2", 60),
    ("d04_pretrigger.tdms", 2048, 1024.0, -0.1, "g", 0),
    ("d02_start_time.tdms", 1997, 1024.0, 0.05, "g", 0),
    ("d13_rate.tdms", 2048, 25600.0, 0.0, "g", 0),
    ("d14_text_channel.tdms", 2048, 1024.0, 0.0, "g", 0),
    ("t01_label_g.uff", 256, 256.0, 0.0, "g", 0),
    ("t02_ms.uff", 256, 256.0, 0.0, "g", 0),
    ("t03_pretrigger.uff", 256, 256.0, -0.125, "g", 0),
    ("t04_uneven.uff", 256, 256.0, 0.0, "g", 0),
]


@pytest.mark.parametrize("by_mapping", [False, True])
@pytest.mark.parametrize(("name", "n", "rate", "start", "unit", "missing"), RECORDINGS)
def test_recordings_with_rate_start_and_gaps_of_the_file(
    reports: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    n: int,
    rate: float,
    start: float,
    unit: str,
    missing: int,
    by_mapping: bool,
) -> None:
    words = f"convert R/{name} OUT.h5"
    if by_mapping:
        assert answered(reports, tmp_path, capsys, f"new mapping R/{name} --out OUT.toml")[0] == 0
        mapping = tomllib.loads((tmp_path / "out.toml").read_text(encoding="utf-8"))
        assert mapping["channels"][-1]["unit"] == unit
        words += " --map OUT.toml"
    code, said = answered(reports, tmp_path, capsys, words)
    assert code == 0, said
    with Recording(tmp_path / "out.h5") as recording:
        stream = recording.stream()
        samples = stream.read()
        assert (stream.n_samples, stream.sample_rate) == (n, rate)
        assert stream.start_time == pytest.approx(start, abs=1e-9)
        acceleration = stream.channels[-1]
        assert (acceleration.quantity, acceleration.direction) == ("acceleration", "+Z")
        gone = [(part.first, part.end) for part in recording.missing(stream.name)]
    assert gone == ([(700, 760)] if missing else [])
    assert np.flatnonzero(np.isnan(samples[:, -1])).tolist() == (list(range(700, 760)) if missing else [])
    assert ("60 samples (0.06 s) missing after row 700" in said) == bool(missing)


def test_a_later_start_is_cut_and_the_rest_of_a_step_compensated(
    reports: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """50 ms are 51.2 samples: 51 are cut off the earlier channel, which then lags by a fifth of a step."""
    assert answered(reports, tmp_path, capsys, "convert R/d02_start_time.tdms OUT.h5")[0] == 0
    with Recording(tmp_path / "out.h5") as recording:
        force, acceleration = recording.stream().channels
    assert force.input_delay_s == pytest.approx(0.2 / 1024, rel=1e-6)
    assert acceleration.input_delay_s is None


@pytest.mark.parametrize("rate", [1000, 500, 1000.2])
def test_a_rate_that_is_typed_does_not_close_a_gap(
    reports: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], rate: float
) -> None:
    channel = '[[channels]]\nname = "Fz"\nquantity = "force"\nunit = "N"\ncolumn = "Fz (N)"\n'
    (tmp_path / "rate.toml").write_text(f"sample_rate = {rate}\n{channel}")
    code, said = answered(reports, tmp_path, capsys, f"convert R/c08_gap.csv OUT.h5 --map {tmp_path / 'rate.toml'}")
    if rate == 500:
        assert code == 2
        assert "sample_rate = 500 Hz in the mapping, but time 1 says 1000 Hz" in said
        return
    assert code == 0, said
    with h5py.File(tmp_path / "out.h5") as file:
        assert file["signals/main/samples"].shape == (2000, 1)
    code, said = answered(reports, tmp_path, capsys, f"convert R/c38_slowdrift.csv OUT2.h5 --map {tmp_path}/rate.toml")
    assert code == 2
    assert "off" in said


def test_a_mat_file_of_an_frf_gets_a_mapping_of_frfs(
    reports: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert answered(reports, tmp_path, capsys, "new mapping R/m01_plain.mat --out OUT.toml")[0] == 0
    assert tomllib.loads((tmp_path / "out.toml").read_text())["frf"]["values"] == "H"


def test_a_file_that_says_what_it_holds_needs_nothing_else(
    reports: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Not even a name for the output; what exists is not replaced."""
    copy = tmp_path / "cut.lvm"
    copy.write_bytes((reports / "c16_lvm.lvm").read_bytes())
    assert answered(reports, tmp_path, capsys, f"convert {copy}")[0] == 0
    with Recording(tmp_path / "cut.h5") as recording:
        assert [channel.degree_of_freedom for channel in recording.stream().channels] == ["TCP:+Z", "HOUSING:+Z"]
    code, said = answered(reports, tmp_path, capsys, f"convert {copy}")
    assert code == 2
    assert "cut.h5" in said
