"""`millfrf tap` from the command line: points told in four ways, summary, provenance, warnings, refusals."""

import gzip
import hashlib
import json
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from simulated_taps import Bench, Hits, Structure, at_resonances, plate, write_taps

from acquisition import Recording, RecordingWriter, StreamDescription
from estimation import Frf, read_frf, write_frf
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import InputError, MillfrfWarning
from millfrf.gate import stored_warnings
from millfrf.steps.convert import convert
from millfrf.steps.estimate import estimate
from millfrf.steps.tap import tap

TIMES = (0.6, 2.1, 3.6)
QUICK = Bench(rate=2560.0, seconds=5.2, noise=1e-4)
SENSORS = ("P1:+Z", "P2:+Z")


@pytest.fixture
def structure() -> Structure:
    return plate()


@pytest.fixture
def folder(tmp_path: Path, structure: Structure, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Three files of a roving hammer, ``t1.h5`` to ``t3.h5``, and the same without places, ``u1.h5`` to ``u3.h5``."""
    for k in (1, 2, 3):
        hits = Hits(TIMES, at=f"P{k}:+Z", again={1: (0.02, 0.3)} if k == 2 else {})
        for name, unnamed in ((f"t{k}", False), (f"u{k}", True)):
            write_taps(tmp_path / f"{name}.h5", structure, hits, SENSORS, replace(QUICK, seed=k), unnamed=unnamed)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def wrong(structure: Structure, frf: Frf) -> float:
    """Largest relative error at resonances."""
    lines = at_resonances(structure, frf.frequencies)
    truth = np.array([[structure.frf(frf.laplace, p, q, 2) for q in frf.excitations] for p in frf.responses])
    truth = truth.transpose(2, 0, 1)[lines]
    error = np.abs(frf.values[lines] - truth)
    return float((error / np.abs(truth).max(axis=(1, 2), keepdims=True)).max())


def test_a_roving_hammer_from_files_to_matrix(
    folder: Path, structure: Structure, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["tap", "t1.h5", "t2.h5", "t3.h5", "--out", "frf.h5"]) == DONE
    frf = read_frf("frf.h5")
    assert frf.excitations == ("P1:+Z", "P2:+Z", "P3:+Z")
    assert frf.responses == SENSORS
    np.testing.assert_array_equal(frf.averages, [[3, 2, 3]] * 2)
    assert wrong(structure, frf) < 0.01
    said = capsys.readouterr()
    assert "warning" not in said.err
    assert "t2.h5      2.101" in said.out
    assert "% once more after 19." in said.out
    assert "force within 20 dB (Hz)" in said.out
    assert "2 responses x 3 excitations" in said.out
    with h5py.File("frf.h5") as file:
        made = json.loads(file.attrs["provenance"])
    assert made["step"] == "tap"
    assert [each["file"] for each in made["sources"]] == ["t1.h5", "t2.h5", "t3.h5"]
    assert made["sources"][0]["sha256"] == hashlib.sha256((folder / "t1.h5").read_bytes()).hexdigest()
    left_out = [tap for tap in made["taps"] if tap["left_out"]]
    assert [(tap["file"], round(tap["time_s"], 2), tap["hit"]) for tap in left_out] == [("t2.h5", 2.1, "P2:+Z")]


TABLES = {
    "points.csv": "file; hit ;a1;a2\nu1.h5; P1:+Z;P1:+Z;P2:+Z\nu2.h5;P2:+Z;P1:+Z;P2:+Z\nu3.h5;P3:+Z;P1:+Z;P2:+Z\n",
    "points.toml": "".join(
        f'[[recording]]\nfile = "u{k}.h5"\nhit = "P{k}:+Z"\nchannels = {{ a1 = "P1:+Z", a2 = "P2:+Z" }}\n'
        for k in (1, 2, 3)
    ),
}


@pytest.mark.parametrize("table", list(TABLES))
def test_a_table_says_which_point_was_hit(folder: Path, structure: Structure, table: str) -> None:
    (folder / table).write_text(TABLES[table], encoding="utf-8")
    assert run(["tap", "u1.h5", "u2.h5", "u3.h5", "--points", table, "--out", "frf.h5"]) == DONE
    frf = read_frf("frf.h5")
    assert frf.excitations == ("P1:+Z", "P2:+Z", "P3:+Z")
    assert frf.responses == SENSORS
    assert wrong(structure, frf) < 0.01
    with h5py.File("frf.h5") as file:
        assert [each["file"] for each in json.loads(file.attrs["provenance"])["sources"]][-1] == table


def test_several_points_hit_in_one_file_are_told_by_their_times(folder: Path, structure: Structure) -> None:
    """One hammer channel that says nothing of where it hit; the table does."""
    with Recording("u1.h5") as each, Recording("u3.h5") as other:
        both = np.vstack([each.stream().read(), other.stream().read()])
        description = StreamDescription("main", QUICK.rate, 0.0, each.stream().channels)
    with RecordingWriter(folder / "both.h5", [description], dtype="float64") as writer:
        writer.append("main", both)
    rows = "both.h5,P1:+Z,0,5.2,P1:+Z,P2:+Z\nboth.h5,P3:+Z,5.2,,P1:+Z,P2:+Z\n"
    (folder / "points.csv").write_text("file,hit,from_s,to_s,a1,a2\n" + rows, encoding="utf-8")
    assert run(["tap", "both.h5", "--points", "points.csv", "--out", "frf.h5"]) == DONE
    frf = read_frf("frf.h5")
    assert frf.excitations == ("P1:+Z", "P3:+Z")
    np.testing.assert_array_equal(frf.averages, [[3, 3]] * 2)
    assert wrong(structure, frf) < 0.01


def test_the_set_up_says_which_point_was_hit(folder: Path, structure: Structure) -> None:
    for k in (1, 2):
        hits = Hits(TIMES, at=f"P{k}:+Z")
        setup = f'[hammer]\npoint = "P{k}:+Z"\n'
        write_taps(folder / f"s{k}.h5", structure, hits, SENSORS, replace(QUICK, seed=k), unnamed=True, setup=setup)
    assert run(["tap", "s1.h5", "s2.h5", "--out", "frf.h5"]) == DONE
    assert read_frf("frf.h5").excitations == ("P1:+Z", "P2:+Z")


def test_one_point_for_all_files(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A roving sensor whose files do not say where the hammer hit: averages where they measured the same."""
    assert run(["tap", "u1.h5", "--point", "P1:+Z", "--out", "frf.h5"]) == DONE
    assert read_frf("frf.h5").excitations == ("P1:+Z",)
    assert "the position of a1, a2 is not known" in capsys.readouterr().err


def test_a_single_tap_warns_and_is_right(
    folder: Path, structure: Structure, capsys: pytest.CaptureFixture[str]
) -> None:
    write_taps(folder / "one.h5", structure, Hits((0.1,)), SENSORS, replace(QUICK, seconds=2.0))
    assert run(["tap", "one.h5", "--out", "frf.h5"]) == DONE
    assert "2 of 2 entries rest on a single tap: they have no coherence" in capsys.readouterr().err
    frf = read_frf("frf.h5")
    assert frf.coherence is None
    assert wrong(structure, frf) < 0.01
    assert run(["inspect", "frf.h5"]) == DONE
    assert "rest on a single tap" in capsys.readouterr().out


def test_an_exponential_window_is_told_and_lobes_refuse_its_frf(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    light = plate(damping=(0.004, 0.003, 0.002, 0.002))
    write_taps(folder / "one.h5", light, Hits((0.05,), at="P1:+Z"), ("P1:+Z",), replace(QUICK, seconds=0.8))
    assert run(["tap", "one.h5", "--out", "frf.h5"]) == DONE
    assert "whose damping the fit subtracts" in capsys.readouterr().out
    frf = read_frf("frf.h5")
    assert frf.exponential_time_constant is not None
    assert wrong(light, frf) < 0.01
    (folder / "cut.toml").write_text(
        "[cutting]\nteeth = 2\ndiameter_m = 0.0127\nedge_angle_deg = 90.0\nktc_pa = 119e6\nkrc = 0.17\nkac = 0.33\n"
        "start_angle_deg = 90.0\nexit_angle_deg = 180.0\nfeed_per_tooth_m = 0.15e-3\n",
        encoding="utf-8",
    )
    command = "lobes frf.h5 --cutting cut.toml --speeds 1000 1100 2 --max-depth 0.005 --out lobes.csv"
    assert run(command.split()) == BAD_INPUT
    assert "Hz of damping" in capsys.readouterr().err
    assert not (folder / "lobes.csv").exists()
    assert run(["tap", "one.h5", "--exponential", "none", "--out", "other.h5"]) == DONE
    assert "remains at the end of the segment" in capsys.readouterr().err


def test_every_choice_of_responses_gets_the_same_window(folder: Path) -> None:
    """FRFs of tip and sensor of the same taps: before, each had the window of its own slowest mode."""
    light = plate(damping=(0.004, 0.003, 0.002, 0.002))
    write_taps(folder / "one.h5", light, Hits((0.05,), at="P1:+Z"), ("P1:+Z", "P4:+Z"), replace(QUICK, seconds=0.8))
    constants = []
    for number, chosen in enumerate(("a1", "a2")):
        assert run(["tap", "one.h5", "--response", chosen, "--out", f"{number}.h5"]) == DONE
        constants.append(read_frf(f"{number}.h5").exponential_time_constant)
    assert constants[0] is not None
    assert constants[0] == constants[1]


def test_a_sensor_that_moved_unsaid_is_doubted(
    folder: Path, structure: Structure, capsys: pytest.CaptureFixture[str]
) -> None:
    moved = replace(structure, shapes=structure.shapes | {"P2:+Z": structure.shapes["P4:+Z"]})
    write_taps(folder / "t1_again.h5", moved, Hits(TIMES), SENSORS, replace(QUICK, seed=9))
    assert run(["tap", "t1.h5", "t1_again.h5", "--out", "frf.h5"]) == DONE
    assert "and the other files disagree on P2:+Z / P1:+Z" in capsys.readouterr().err


@pytest.mark.parametrize("extra", [["--window", "hann"], ["--window", "boxcar", "--segment", "2", "--overlap", "0"]])
def test_estimate_refuses_taps_and_names_the_command(
    folder: Path, extra: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    """Under the default window as with segments that begin anywhere; nothing is written."""
    assert run(["estimate", "t1.h5", *extra, "--out", "frf.h5"]) == BAD_INPUT
    said = capsys.readouterr().err
    assert "t1.h5: the force on f1 comes in 3 taps" in said
    assert "millfrf tap" in said
    assert not (folder / "frf.h5").exists()


def test_what_estimate_refuses_was_wrong_many_times_over(folder: Path, structure: Structure) -> None:
    """The case that was found: one tap at the beginning of a segment under a Hann window."""
    path = write_taps(folder / "one.h5", structure, Hits((0.05,)), SENSORS, replace(QUICK, seconds=2.0))
    with pytest.raises(InputError, match="1 tap of a hammer"):
        estimate(path, segment=2.0)
    with Recording(path) as recording:
        samples = recording.stream().read()
    lines = np.fft.rfft(samples * np.hanning(len(samples))[:, None], axis=0)
    frequencies = np.fft.rfftfreq(len(samples), 1 / QUICK.rate)
    near = at_resonances(structure, frequencies)
    truth = structure.frf(2j * np.pi * frequencies, "P1:+Z", "P1:+Z", 2)
    assert np.abs(lines[near, 1] / lines[near, 0] / truth[near]).max() > 5


def test_estimate_keeps_taps_at_the_beginning_of_segments_without_a_window(folder: Path, structure: Structure) -> None:
    path = write_taps(folder / "even.h5", structure, Hits((0.05, 1.55, 3.05)), SENSORS, replace(QUICK, seconds=4.5))
    result = estimate(path, segment=1.5, overlap=0.0, window="boxcar")
    inside = (result.frf.frequencies > 20) & (result.frf.frequencies < 500)
    frf = replace(
        result.frf,
        frequencies=result.frf.frequencies[inside],
        values=result.frf.values[inside],
        valid=result.frf.valid[inside],
        multiple_coherence=None,
        covariance=None,
    )
    assert wrong(structure, frf) < 0.02


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["t1.h5", "t2.h5", "u3.h5"], "nothing says which point was hit in u3.h5"),
        (["t1.h5", "--exponential", "much"], "--exponential much is not understood"),
        (["t1.h5", "--segment", "4"], "none of its 3 taps can be used"),
        (["t1.h5", "--points", "none.csv"], "no file none.csv"),
        (["t1.h5", "--point", "P1"], "P1:' is not understood|P1: is not understood"),
        (["t1.h5", "--point", "P1:+Z", "--points", "points.csv"], "give one of them"),
        (["t1.h5", "--response", "a7"], "no channel a7"),
        (["t1.h5", "t1.h5"], "same recording"),
        (["quiet.h5"], "no tap found"),
        (["t1.h5", "fast.h5"], "2560 and 5120 Hz"),
    ],
)
def test_bad_input_is_one_line_and_nothing_is_written(
    folder: Path, structure: Structure, arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "points.csv").write_text("file,hit\nt1.h5,P1:+Z\n", encoding="utf-8")
    write_taps(folder / "fast.h5", structure, Hits((0.6,)), SENSORS, replace(QUICK, rate=5120.0, seconds=1.5))
    with Recording("t1.h5") as recording:
        description, length = recording.stream().description, recording.stream().n_samples
    with RecordingWriter(folder / "quiet.h5", [description]) as writer:
        writer.append("main", np.random.default_rng(1).standard_normal((length, 3)))
    before = sorted(path.name for path in folder.iterdir())
    assert run(["tap", *arguments, "--out", "frf.h5"]) == BAD_INPUT
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert any(each in error for each in said.split("|")), error
    assert sorted(path.name for path in folder.iterdir()) == before


def test_a_triggered_file_whose_only_tap_hit_twice_is_left_out(
    folder: Path, structure: Structure, capsys: pytest.CaptureFixture[str]
) -> None:
    for k, again in enumerate(({}, {0: (0.02, 0.3)}, {}), start=1):
        hits = Hits((0.1,), again=again)
        write_taps(folder / f"single{k}.h5", structure, hits, SENSORS, replace(QUICK, seconds=1.6, seed=k))
    assert run(["tap", "single1.h5", "single2.h5", "single3.h5", "--out", "frf.h5"]) == DONE
    said = capsys.readouterr()
    assert "single2.h5: its only tap cannot be used (1 x double hit" in said.err
    frf = read_frf("frf.h5")
    np.testing.assert_array_equal(frf.averages, [[2]] * 2)
    assert wrong(structure, frf) < 0.01
    with h5py.File("frf.h5") as file:
        assert file.attrs["title"] == "H1 of 2 taps in 2 recordings"
    # without another file of the same point, or with fewer responses there, the point would be lost
    assert run(["tap", "single2.h5", "t3.h5", "--out", "lost.h5"]) == BAD_INPUT
    assert "single2.h5: its only tap cannot be used" in capsys.readouterr().err


def test_forces_that_no_hammer_makes_are_named(
    folder: Path, structure: Structure, capsys: pytest.CaptureFixture[str]
) -> None:
    write_taps(folder / "kilo.h5", structure, Hits(TIMES, peak=2e5), SENSORS, QUICK)
    assert run(["tap", "kilo.h5", "--out", "frf.h5"]) == DONE
    assert "more than hammers measure (22 kN): correct the unit" in capsys.readouterr().err


TABLE_MISTAKES = {
    "point\nP1:+Z\n": "no column 'file'",
    "file,hit\nt1.h5,P1:Z\n": "P1:Z is not understood",
    "file,hit\nt9.h5,P1:+Z\n": "t1.h5 is not in",
    "file,hit,a9\nt1.h5,P1:+Z,P2:+Z\n": "'a9'",
    "file,hit,from_s,to_s\nt1.h5,P1:+Z,3,2\n": "from_s = 3",
    "file,hit\nt1.h5,P1:+Z,P2:+Z\n": "more cells",
}


@pytest.mark.parametrize("text", list(TABLE_MISTAKES))
def test_tables_that_are_wrong_say_where(folder: Path, text: str, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "points.csv").write_text(text, encoding="utf-8")
    assert run(["tap", "t1.h5", "--points", "points.csv", "--out", "frf.h5"]) == BAD_INPUT
    assert TABLE_MISTAKES[text] in capsys.readouterr().err


def test_clipping_throughout_leaves_no_tap(
    folder: Path, structure: Structure, capsys: pytest.CaptureFixture[str]
) -> None:
    bench = replace(QUICK, full_scale=(100.0, None))
    write_taps(folder / "clipped.h5", structure, Hits(TIMES), SENSORS, bench)
    assert run(["tap", "clipped.h5", "--out", "frf.h5"]) == BAD_INPUT
    said = capsys.readouterr().err
    assert "none of its 3 taps can be used (3 x overload" in said
    assert "larger range" in said


def test_frfs_of_unlike_windows_do_not_calibrate_together(folder: Path, structure: Structure) -> None:
    from millfrf.gate import check_tip_and_sensor
    from modal_fit import ModalModel

    assert run(["tap", "t1.h5", "--out", "frf.h5"]) == DONE
    tip = read_frf("frf.h5")
    write_frf("windowed.h5", replace(tip, exponential_time_constant=0.2))
    single = np.ones((1, 2)) + 0j
    model = ModalModel(np.array([-3 + 400j]), single, single[:, :1], SENSORS, ("P1:+Z",))
    with pytest.raises(InputError, match=r"none and 0\.2 s"):
        check_tip_and_sensor(model, tip, read_frf("windowed.h5"))


@pytest.mark.parametrize(
    ("times", "hum"),
    [((0.2, 1.7, 3.2, 4.7), 0.1), ((0.2, 1.7, 3.2, 4.7), 0.003), ((0.02, 1.52, 3.02), 0.1)],
    ids=["in spectrum and before the taps", "before the taps only", "in the spectrum only"],
)
def test_hum_is_named_once(tmp_path: Path, times: tuple[float, ...], hum: float) -> None:
    bench = Bench(rate=2560.0, seconds=times[-1] + 1.5, hum=hum)
    structure = plate(damping=(0.05, 0.04, 0.03, 0.03))
    path = write_taps(tmp_path / "a.h5", structure, Hits(times, at="P1:+Z"), ("P1:+Z",), bench)
    with pytest.warns(MillfrfWarning, match="hum"):
        result = tap(path)
    assert sum("hum" in warning for warning in result.warnings) == 1


def test_subtracted_hum_is_no_doubt_about_what_follows(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    """The warning of the taps appeared again with the FRF, the model and its limits."""
    bench = Bench(rate=2560.0, seconds=7.0, hum=0.1, noise=1e-4, seed=3)
    structure = plate(damping=(0.05, 0.04, 0.03, 0.03))
    path = write_taps(tmp_path / "a.h5", structure, Hits((0.5, 2.13, 3.79, 5.41), at="P1:+Z"), ("P1:+Z",), bench)
    result = tap(path, out=tmp_path / "frf.h5")
    assert [text for text in result.warnings if "mains hum" in text]
    assert not [text for text in stored_warnings(tmp_path / "frf.h5") if "hum" in text]


def test_a_mode_near_the_mains_is_not_called_hum(tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    """Single taps of 1 s, soon after the start: a peak three lines wide at 52 Hz; before: "mains hum at 50 Hz"."""
    shapes = {"P1:+Z": np.array([0.7, 0.4])}
    structure = Structure(np.array([52.0, 83.0]), np.array([0.04, 0.03]), shapes)
    benches = [Bench(rate=2048.0, seconds=1.0, seed=seed) for seed in range(5)]
    result = tap(
        *(
            write_taps(tmp_path / f"{k}.h5", structure, Hits((0.05 + 0.001 * k,)), ("P1:+Z",), bench)
            for k, bench in enumerate(benches)
        )
    )
    assert not [text for text in result.warnings if "hum" in text]


@pytest.mark.shared_data
@pytest.mark.filterwarnings("ignore::millfrf.core.MillfrfWarning")
@pytest.mark.parametrize(
    ("name", "says"),
    [("h06_delay2", "is at least 0.97"), ("h10_mains", "mains hum in acc at 50.00 Hz: a steady tone")],
)
def test_taps_that_others_recorded_late_and_with_hum(shared_data: Path, tmp_path: Path, name: str, says: str) -> None:
    """Truth: receptance of modes at 30 Hz, 3 %, 12 kg and 62 Hz, 2 %, 20 kg; the response 2 samples of 2048 Hz late."""
    folder = shared_data.parent / "reports"
    if not folder.is_dir():
        pytest.skip("no folder of reports")
    (tmp_path / "rec.csv").write_bytes(gzip.decompress((folder / f"{name}.csv.gz").read_bytes()))
    convert(tmp_path / "rec.csv", tmp_path / "rec.h5", map=folder / "tap.toml")
    result = tap(tmp_path / "rec.h5")
    assert [text for text in result.warnings if says in text]
    if name == "h10_mains":
        assert result.settings.time_constant is None
        frf = result.frf
        lines = (frf.frequencies > 20) & (frf.frequencies < 100)
        w = 2 * np.pi * frf.frequencies[lines]
        truth = sum(
            -(w**2) / (m * ((2 * np.pi * f) ** 2 - w**2 + 2j * z * 2 * np.pi * f * w))
            for f, z, m in ((30.0, 0.03, 12.0), (62.0, 0.02, 20.0))
        )
        assert np.abs(frf.values[lines, 0, 0] / truth - 1).max() < 0.01
