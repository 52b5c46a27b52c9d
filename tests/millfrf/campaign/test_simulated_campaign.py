"""The simulated campaign: its notes, what is hidden in it, its broken files, and that fits find the truth."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition import Recording
from millfrf.campaign.simulated.make import SimulatedCampaign, laboratory_of, make_campaign
from millfrf.campaign.simulated.recordings import write_recording
from millfrf.campaign.simulated.true_robot import FAULTS, LOWEST, Condition
from millfrf.campaign.simulated.true_robot import WORK_AREA_HIGHEST as HIGHEST
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import InputError
from millfrf.gate import check_recordings
from millfrf.steps.fit import fit

POSES, RECORDINGS = 6, 36


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six poses, two sessions of three immersions."""
    out = tmp_path_factory.mktemp("simulated") / "campaign"
    make_campaign(SimulatedCampaign(out, RECORDINGS, POSES, seed=1))
    return out


@pytest.fixture(scope="module")
def truth(folder: Path) -> dict:
    """What is concealed."""
    return json.loads((folder / "concealed.json").read_text())


def _fault(truth: dict, kind: str) -> str:
    return next(each["file"] for each in truth["broken"] if each["fault"] == kind)


def test_every_whole_recording_states_robot_pose_conditions_and_cut(folder: Path, truth: dict) -> None:
    broken = {each["file"] for each in truth["broken"]}
    paths = sorted((folder / "recordings").glob("*.h5"))
    assert len(paths) == RECORDINGS
    postures = {pose["pose"]: pose["posture_deg"] for pose in truth["poses"]}
    planned = {each["name"]: each for each in truth["recordings"]}
    for path in paths:
        if f"recordings/{path.name}" in broken:
            continue
        with Recording(path) as recording:
            notes = tomllib.loads(recording.setup)
            assert recording.recorded_at == planned[path.stem]["recorded_at"]
        assert notes["robot"]["posture_deg"] == postures[notes["robot"]["pose"]]
        assert path.stem.startswith(notes["robot"]["pose"])
        assert notes["conditions"]["temperature_c"] == planned[path.stem]["temperature"]
        assert notes["conditions"]["level"] == 1.0
        assert notes["cut"]["depth_m"] > 0
        assert notes["tool"]["name"]


def test_one_file_of_each_fault_lies_outside_the_drifting_pose(folder: Path, truth: dict) -> None:
    assert sorted(each["fault"] for each in truth["broken"]) == sorted(FAULTS)
    assert all(truth["drift"]["pose"] not in each["file"] for each in truth["broken"])


def test_the_truth_tells_how_far_the_drift_moves_each_mode(truth: dict) -> None:
    first, last = (np.array(truth["drift"]["frequency_hz_in_each_session"][k]) for k in (0, -1))
    pose = next(each for each in truth["poses"] if each["pose"] == truth["drift"]["pose"])
    assert np.allclose(first, pose["frequency_hz"])
    assert (last <= first * (1 + 1e-9)).all()  # a joint that softens raises no frequency, but for rounding
    assert 0.008 < (1 - last / first).max() < 0.02


@pytest.mark.parametrize("kind", ["truncated", "no HDF5 file", "damaged block"])
def test_files_broken_on_the_way_are_refused(folder: Path, truth: dict, kind: str) -> None:
    with pytest.raises(InputError):
        check_recordings([folder / _fault(truth, kind)])


def test_the_gate_doubts_the_clipped_recording(folder: Path, truth: dict) -> None:
    assert any("clipped" in doubt for doubt in check_recordings([folder / _fault(truth, "clipped")]))


def test_the_wrong_posture_is_that_of_another_pose(folder: Path, truth: dict) -> None:
    postures = {pose["pose"]: pose["posture_deg"] for pose in truth["poses"]}
    with Recording(folder / _fault(truth, "wrong posture")) as recording:
        notes = tomllib.loads(recording.setup)["robot"]
    assert notes["posture_deg"] in [other for name, other in postures.items() if name != notes["pose"]]


def test_postures_hold_the_tool_down_inside_the_work_area() -> None:
    laboratory, _ = laboratory_of(SimulatedCampaign(Path("unused"), RECORDINGS, POSES, seed=3))
    mechanism = laboratory.true.robot.mechanism
    assert len(np.unique(laboratory.postures.round(6), axis=0)) == POSES
    for q in laboratory.postures:
        tool = mechanism.transforms(q)[mechanism.index(mechanism.tool)]
        assert np.allclose(tool[:3, 2], [0, 0, -1], atol=1e-4)
        assert (tool[:3, 3] > LOWEST[:3] - 1e-3).all()
        assert (tool[:3, 3] < HIGHEST[:3] + 1e-3).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_drift_is_seen_in_one_pose_and_is_not_absurd(seed: int) -> None:
    laboratory, planned = laboratory_of(SimulatedCampaign(Path("unused"), 60, POSES, seed))
    drift, pose = laboratory.drift, laboratory.drift.pose
    changes = {}
    for name in (pose, (pose + 1) % POSES):
        first, last = (
            laboratory.true.structure(
                laboratory.postures[name], replace(drift.condition(each), temperature=22.0)
            ).natural_frequencies[:6]
            for each in (
                next(each for each in planned if each.pose == name and each.session == session) for session in (1, 3)
            )
        )
        changes[name] = np.abs(last / first - 1).max()
    assert 0.008 < changes.pop(pose) < 0.02
    assert list(changes.values()) == [0.0]


def test_warm_joints_are_softer_and_lose_less() -> None:
    laboratory, _ = laboratory_of(SimulatedCampaign(Path("unused"), RECORDINGS, POSES, seed=2))
    cold, warm = (laboratory.true.structure(laboratory.postures[0], Condition(t)) for t in (17.0, 27.0))
    change = warm.natural_frequencies[:6] / cold.natural_frequencies[:6] - 1
    assert (change < -0.0003).all()
    assert (change > -0.006).all()
    assert (warm.damping_ratios[:6] < cold.damping_ratios[:6]).all()


def test_modes_of_real_shape_start_no_velocity_at_once() -> None:
    laboratory, _ = laboratory_of(SimulatedCampaign(Path("unused"), RECORDINGS, POSES, seed=2))
    structure = laboratory.true.structure(laboratory.postures[1])
    step = 2 * np.real(np.einsum("rp,rq->pq", structure.right, structure.left))
    assert np.abs(step).max() < 1e-12 * np.abs(structure.right).max() * np.abs(structure.left).max()


def test_a_recording_is_the_same_for_a_seed_and_another_for_another(tmp_path: Path) -> None:
    samples = []
    for number, seed in enumerate((5, 5, 6)):
        laboratory, planned = laboratory_of(SimulatedCampaign(Path("unused"), RECORDINGS, POSES, seed))
        where = tmp_path / str(number)
        where.mkdir()
        chosen = next(each for each in planned if each.fault is None)
        write_recording(laboratory, chosen, where)
        with Recording(where / f"{chosen.name}.h5") as recording:
            samples.append(np.concatenate(list(recording.stream(None).blocks())))
    assert np.array_equal(samples[0], samples[1])
    assert not np.array_equal(samples[0], samples[2])


@pytest.mark.long
def test_a_fit_of_three_immersions_finds_the_true_frequencies(folder: Path, truth: dict) -> None:
    laboratory, planned = laboratory_of(SimulatedCampaign(folder, RECORDINGS, POSES, seed=1))
    drift = laboratory.drift
    chosen = [each for each in planned if each.pose == drift.pose and each.session == 2]
    paths = [folder / "recordings" / f"{each.name}.h5" for each in chosen]
    model = fit(*paths, band=(8.0, 95.0)).model
    true = laboratory.true.structure(laboratory.postures[drift.pose], drift.condition(chosen[1]))
    known = model.standard_errors()
    assert known is not None
    for frequency, error in zip(model.natural_frequencies, known[0], strict=True):
        nearest = true.natural_frequencies[np.argmin(np.abs(true.natural_frequencies - frequency))]
        assert abs(frequency - nearest) < 4 * error
        assert 2e-5 < error / frequency < 5e-3


@pytest.mark.long
def test_the_command_makes_the_campaign_and_refuses_what_cannot_be(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = ["demo", "--campaign", "--out", str(tmp_path / "made")]
    assert run([*asked, "--recordings", "200", "--poses", "3"]) == BAD_INPUT
    assert "3 poses are too few" in capsys.readouterr().err
    assert run([*asked, "--recordings", "50", "--poses", "20"]) == BAD_INPUT
    assert "50 recordings in 20 poses" in capsys.readouterr().err
    assert not (tmp_path / "made").exists()
    assert run([*asked, "--recordings", "36", "--poses", "6", "--seed", "4"]) == DONE
    assert len(list((tmp_path / "made" / "recordings").iterdir())) == 36
    assert tomllib.loads((tmp_path / "made" / "campaign.toml").read_text())["campaign"]["robot"] == "kuka_kr90_r3100"
