"""`concealed.json`: the truth of a simulated campaign."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import TIP
from replay_data import select

from .at_rest import BAND
from .recordings import Laboratory
from .schedule import PlannedRecording, pose_name
from .true_robot import LESS_LOSS_PER_KELVIN, REFERENCE_TEMPERATURE, SOFTER_PER_KELVIN, Condition

FORMAT = "millfrf.concealed_campaign"


def write_concealed(path: Path, laboratory: Laboratory, planned: Sequence[PlannedRecording], seed: int) -> None:
    """Write what was hidden, which files are broken, and the true modes of every pose."""
    true, drift = laboratory.true, laboratory.drift
    constants = {
        name: np.asarray(getattr(true, name)).tolist() for name in ("stiffening", "wave", "phase", "loss", "friction")
    }
    content: dict[str, Any] = {
        "format": FORMAT,
        "format_version": 1,
        "seed": seed,
        "robot": laboratory.robot,
        "joints": [joint.frame for joint in true.driven_joints()],
        "stiffness_at_light_load_nm_per_rad": [float(joint.stiffness[5]) for joint in true.driven_joints()],
        **constants,
        "drift": {
            "pose": pose_name(drift.pose),
            "joint": drift.joint,
            "stiffness_factor_in_each_session": list(drift.factors),
            "frequency_hz_in_each_session": [_softened(laboratory, factor) for factor in drift.factors],
        },
        "temperature": {
            "reference_c": REFERENCE_TEMPERATURE,
            "stiffness_lost_per_kelvin": SOFTER_PER_KELVIN,
            "loss_lost_per_kelvin": LESS_LOSS_PER_KELVIN,
        },
        "level": "no property of the robot depends on the level",
        "broken": [{"file": f"recordings/{one.name}.h5", "fault": one.fault} for one in planned if one.fault],
        "poses": [_pose(laboratory, number) for number in range(len(laboratory.postures))],
        "recordings": [asdict(one) for one in planned],
    }
    path.write_text(json.dumps(content, indent=1), encoding="utf-8")


def _softened(laboratory: Laboratory, factor: float) -> list[float]:
    """True frequencies of the drifting pose at the reference temperature, Hz."""
    condition = Condition(joint_factors={laboratory.drift.joint: factor})
    found = laboratory.true.structure(laboratory.postures[laboratory.drift.pose], condition).natural_frequencies
    return [float(value) for value in found[found < BAND[1]]]


def _pose(laboratory: Laboratory, number: int) -> dict[str, Any]:
    """True modes at the tip below the band's end, at the reference temperature, without drift."""
    q = laboratory.postures[number]
    model = select(laboratory.true.structure(q, Condition()), TIP, TIP)
    low = model.natural_frequencies < BAND[1]
    return {
        "pose": pose_name(number),
        "posture_deg": np.degrees(q).round(3).tolist(),
        "frequency_hz": model.natural_frequencies[low].tolist(),
        "damping_ratio": model.damping_ratios[low].tolist(),
        "mass_normalised_shape": model.right.real[low].tolist(),
    }
