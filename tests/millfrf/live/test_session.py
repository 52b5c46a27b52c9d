"""The page of a session: tests are stacked, what is missing is said, and nothing is drawn where there is no data."""

import math
import re
import tomllib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition import Block, Channel, Recording
from acquisition.drivers.replay import ReplaySource
from estimation import CrossSpectra, SpectralAccumulator, settings_for, to_receptance
from millfrf.command_line import run
from millfrf.live.frequency_drawings import all_drawings, first_choice
from millfrf.live.monitor import LiveMonitor, Snapshot
from millfrf.live.spectra import BandProgress
from millfrf.live.standing import standing_of
from millfrf.live.tests_of_session import MilledSpeeds, SessionPlan, SessionTest, force_power
from millfrf.steps.plan import plan_from_file
from millfrf.steps.recording.acquire import live_settings, open_session, session_tests
from replay_data import default_structure

SESSION = """
duration_s = {seconds}
band_hz = [5.0, 60.0]
[pose]
name = "{pose}"
[cutting]
teeth = 2
diameter_m = 0.0127
ktc_pa = 119e6
krc = 0.17
kac = 0.33
start_angle_deg = 0.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.00015
[cut]
start_angle_deg = {start}
exit_angle_deg = {leave}
[plan]
band_hz = [14.0, 24.0]
depth_m = 0.002
resolution_hz = 0.25
acceleration_noise = 5e-4
frf_error_m_per_n = 1e-6
immersion_widths_deg = [45]
[device]
driver = "simulated"
speed = 10000.0
"""
PLAN = SessionPlan(((0.0, 45.0), (81.6, 98.4), (135.0, 180.0)), (420.0, 720.0), 40.0, 2)


def _session(
    folder: Path, immersion: tuple[float, float], pose: str = "A", extra: str = "", seconds: float = 40
) -> Path:
    path = folder / "session.toml"
    path.write_text(SESSION.format(start=immersion[0], leave=immersion[1], pose=pose, seconds=seconds) + extra)
    return path


@pytest.fixture(scope="module")
def milled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the three planned sweeps, recorded from the simulated device."""
    folder = tmp_path_factory.mktemp("session")
    for number, immersion in enumerate(PLAN.immersions, 1):
        session = _session(folder, immersion, extra=f"seed = {number}\n")
        assert run(["acquire", str(session), "--out", str(folder / f"sweep{number}.h5")]) == 0
    return folder


def _seen(folder: Path, number: int, share: float = 1.0, **changed: object) -> tuple[Snapshot, LiveMonitor]:
    """What the page draws when test ``number`` of a folder is recorded again up to a share of it."""
    opened = open_session(_session(folder, PLAN.immersions[number - 1]))
    source = ReplaySource(folder / f"sweep{number}.h5")
    opened = replace(opened, source=source)
    tests = session_tests(opened, folder / f"sweep{number}.h5")
    settings = replace(live_settings(opened.session, tests.plan), **changed)  # type: ignore[arg-type]
    monitor = LiveMonitor(source.streams, settings, tests)
    tests.wait()
    monitor.restart()
    source.open()
    while (taken := source.read()) is not None:
        if isinstance(taken, Block):
            if taken.first_sample > share * (source.n_samples or 0):
                break
            while monitor._background._queue.full():
                pass
        monitor(taken)
    source.close()
    if share == 1.0:
        monitor.finish()
    else:
        monitor._background._queue.join()
        with monitor._background.lock:
            assert monitor._spectra is not None
            monitor._estimate(monitor._spectra)
    shown = monitor.snapshot()
    monitor.close()
    return shown, monitor


def test_three_simulated_sweeps_give_the_frf(milled: Path) -> None:
    shown, monitor = _seen(milled, 3)
    assert shown.frf is not None
    f = shown.frf.frequencies
    band = (f >= 15) & (f <= 23)
    assert shown.known[band].mean() > 0.95
    result = to_receptance(shown.frf).values[band & shown.known]
    structure = default_structure()
    rows = [structure.responses.index(f"HOUSING:+{axis}") for axis in "XYZ"]
    columns = [structure.excitations.index(f"TCP:+{axis}") for axis in "XYZ"]
    true = structure.receptance(f[band & shown.known])[:, rows][:, :, columns]
    for axis in (0, 1):  # the axial force is a seventh of the others
        error = np.linalg.norm(result[:, :, axis] - true[:, :, axis]) / np.linalg.norm(true[:, :, axis])
        assert error < 0.1
    assert shown.standing is not None
    assert [row.state for row in shown.standing.rows] == ["done"] * 3
    assert "missing" not in shown.standing.advice
    curve = _drawn(monitor, shown)["magnitude"]["magnitude.data"]
    assert np.isfinite(curve["y"]).sum() > 200


def _drawn(monitor: LiveMonitor, shown: Snapshot) -> dict[str, dict[str, dict[str, np.ndarray]]]:
    """Columns of all figures for the first choice."""
    choice = first_choice(monitor)
    return {each.name: each.content(shown, choice, ())["sources"] for each in all_drawings(monitor)}


def test_one_sweep_draws_no_frf_and_says_what_is_missing(milled: Path, tmp_path: Path) -> None:
    (tmp_path / "sweep1.h5").write_bytes((milled / "sweep1.h5").read_bytes())
    shown, monitor = _seen(tmp_path, 1, share=0.5)
    drawn = _drawn(monitor, shown)
    assert sum(len(drawn[kind][f"{kind}.data"]["x"]) for kind in ("magnitude", "phase")) == 0
    assert all(not band.enough for band in shown.bands)
    assert shown.standing is not None
    assert [row.state for row in shown.standing.rows] == ["running", "missing", "missing"]
    advice = shown.standing.advice
    missing = re.search(r"^Go on: (\d+) to 720 rpm is missing, about (\d+) s\.", advice)
    assert missing is not None, advice
    assert float(missing[1]) == pytest.approx(570, abs=30)  # half of the sweep, to a half of a segment of 8 s
    assert float(missing[2]) == pytest.approx(20, abs=4)
    assert "Still missing: immersion 81.58 to 98.42°, 135 to 180°, 40 s each." in advice


def test_a_steady_cut_draws_no_noise(tmp_path: Path) -> None:
    session = _session(tmp_path, PLAN.immersions[0], extra="spindle_speed_rpm = 6000\n", seconds=20)
    assert run(["acquire", str(session), "--out", str(tmp_path / "sweep1.h5")]) == 0
    shown, monitor = _seen(tmp_path, 1)
    drawn = _drawn(monitor, shown)
    for kind in ("magnitude", "phase", "coherence"):
        assert len(drawn[kind][f"{kind}.data"]["x"]) == 0, kind
    assert not np.isfinite([band.error for band in shown.bands]).any()


def test_tests_of_another_set_up_are_named_and_left_out(milled: Path, tmp_path: Path) -> None:
    (tmp_path / "sweep1.h5").write_bytes((milled / "sweep1.h5").read_bytes())
    (tmp_path / "broken.h5").write_bytes((milled / "sweep2.h5").read_bytes()[:50_000])
    other = _session(tmp_path, PLAN.immersions[1], extra="sample_rate_hz = 1024\n")
    assert run(["acquire", str(other), "--out", str(tmp_path / "rate.h5")]) == 0
    shown, _ = _seen(tmp_path, 1)
    assert len(shown.notes) == 2
    assert any(note.startswith("broken.h5 is not stacked: ") for note in shown.notes)
    assert "rate.h5 is not stacked: other channels or another sample rate" in shown.notes
    assert shown.standing is not None
    assert sum("rate.h5" in row.cells[1] for row in shown.standing.rows) == 0


def test_simulated_tests_of_another_tool_or_pose_are_not_stacked(milled: Path, tmp_path: Path) -> None:
    """Before: a simulated session dropped its tool and pose, so that all tests were taken as one."""
    (tmp_path / "sweep1.h5").write_bytes((milled / "sweep1.h5").read_bytes())
    tool = '[tool]\nlabel = "end mill"\nflutes = { count = 2, pitch_deg = [0.0, 180.0] }\nsharpened = 2026-03-01\n'
    for name, pose, extra in (("pose.h5", "B", ""), ("tool.h5", "A", tool)):
        session = _session(tmp_path, PLAN.immersions[1], pose, extra)
        assert run(["acquire", str(session), "--out", str(tmp_path / name)]) == 0
        with Recording(tmp_path / name) as recording:
            setup = tomllib.loads(recording.setup)
        assert setup["pose"] == {"name": pose}
        assert setup.get("tool") == tomllib.loads(extra).get("tool")
        assert (setup["cut"]["depth_m"], setup["cutting"]["start_angle_deg"]) == (0.002, 81.6)
    shown, _ = _seen(tmp_path, 1)
    assert sorted(shown.notes) == ["pose.h5 is not stacked: another pose", "tool.h5 is not stacked: another tool"]


def test_the_simulated_device_sweeps_in_the_immersion_of_the_cut(milled: Path) -> None:
    plan = plan_from_file(_session(milled, PLAN.immersions[0]))[0]
    speeds = [speed * 30 / math.pi for speed in plan.spindle_speeds]
    assert speeds == pytest.approx(PLAN.speeds)
    with Recording(milled / "sweep2.h5") as recording:
        times, stated = recording.events["spindle_speed_rpm"].read()
        assert stated == pytest.approx(speeds[0] + (speeds[1] - speeds[0]) * times / plan.duration, rel=1e-3)
        assert "start_angle_deg = 81.6" in recording.setup
        assert "exit_angle_deg = 98.4" in recording.setup


def test_a_device_that_sweeps_and_does_not_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    session = _session(tmp_path, (0, 90), extra="spindle_speed_rpm = 600\nsweep_rpm = [400, 700]\n")
    assert run(["acquire", str(session), "--out", str(tmp_path / "a.h5")]) == 2
    assert "sweeps or runs steadily: remove one" in capsys.readouterr().err


CHANNELS = (Channel("f", "force", "N", "TCP", "+X"), Channel("a", "acceleration", "m/s^2", "TCP", "+X"))


def _spectra() -> CrossSpectra:
    """A force that is white in all directions of one."""
    accumulator = SpectralAccumulator(CHANNELS[:1], CHANNELS[1:], 200.0, settings_for(200.0, 4.0, window="hann"))
    samples = np.random.default_rng(0).standard_normal((8000, 2))
    accumulator.add(samples[:, :1], samples[:, 1:])
    return accumulator.result()


def _test(name: str, immersion: tuple[float, float] | None, speeds: Sequence[float]) -> SessionTest:
    milled = MilledSpeeds()
    milled.add(np.array(speeds))
    return SessionTest(name, force_power(_spectra()), immersion, 40.0, milled)


WHOLE = tuple(np.linspace(420, 720, 400))
GOOD, POOR = BandProgress(14, 24, 1.0, 0.5), BandProgress(14, 24, 0.0, 2.0)


def test_the_advice_follows_the_plan() -> None:
    done = [_test(f"s{k}", immersion, WHOLE) for k, immersion in enumerate(PLAN.immersions)]
    assert standing_of(PLAN, done, None, [GOOD], True).advice == "Enough: every band reaches the planned error."
    # 120 s gave twice the planned error: four times as long is needed, 360 s more
    assert "Go on for about 6 min in all" in standing_of(PLAN, done, None, [POOR], True).advice
    half = _test("s2", (135.5, 179.0), WHOLE[:200])
    said = standing_of(PLAN, done[:2], half, [GOOD], True)
    assert said.advice == "Go on: 570 to 720 rpm is missing, about 20 s."
    assert said.rows[2].cells[2:] == ("420 to 570", "40 of 40", "running")
    middle = _test("s1", PLAN.immersions[1], [*WHOLE[:100], *WHOLE[300:]])
    said = standing_of(PLAN, [done[0], middle, done[2]], None, [GOOD], True)
    assert said.advice == "In 81.6 to 98.4°: 495 to 644 rpm is missing, about 20 s."
    assert said.rows[1].cells[2] == "420 to 495, 644 to 720"
    stray = _test("s9", (0.0, 180.0), WHOLE)
    said = standing_of(PLAN, done, stray, [GOOD], True)
    assert said.advice.startswith("This test has 0 to 180°, which is not in the plan.")
    assert said.rows[3].cells[-1] == "running"
    assert standing_of(PLAN, [], None, [], False).advice.startswith("Still missing: immersion 0 to 45°")


def test_without_a_plan_the_forces_tell() -> None:
    single = _test("s0", None, WHOLE)
    assert "not independent in 1 test: mill another immersion" in standing_of(None, [], single, [], False).advice
    assert standing_of(None, [single], None, [GOOD], True).rows[0].cells[-1] == "recorded"
