"""Learned postures as a file: JSON, format ``millfrf.learned_postures`` version 1, readable without the program."""

import json
import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from millfrf.core import FileFormatError, InputError, Real, mistake_in_words, writing_whole_file

from ..kinematics.joint_values import typed_values
from ..spatial.spatial_robot import SpatialRobot
from .learning import LearnedPostures, assembled
from .measured_modes import MeasuredModes
from .modal_basis import ModalBasis, basis_at, part_names
from .process import NAMES

FORMAT, FORMAT_VERSION = "millfrf.learned_postures", 1

SAME = 1e-4
"""Relative difference of modelled frequencies up to which a robot is the one that was learned with."""


class _Table(BaseModel):
    model_config = ConfigDict(extra="ignore", allow_inf_nan=False)


class _Mode(_Table):
    frequency_hz: float
    damping_ratio: float
    shape: list[float]
    relative_errors: tuple[float, float, float]
    model_mode: int | None


class _Posture(_Table):
    name: str
    driven_rad_m: list[float]
    directions: list[tuple[float, float, float]]
    modelled_frequencies_hz: list[float]
    stiffness_factors: dict[str, float]
    modes: list[_Mode]


class _Hyperparameters(_Table):
    best: dict[str, float]
    draws: list[list[float]]


class _File(_Table):
    format: Literal["millfrf.learned_postures"]
    format_version: Literal[1]
    postures: list[_Posture]
    mass_factors: dict[str, float]
    hyperparameters: _Hyperparameters


def write_learned_postures(path: str | os.PathLike[str], learned: LearnedPostures) -> None:
    """Write what was measured, which modes were taken for the same, and all amplitudes; whole.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    joints, bodies = part_names(learned.robot)
    content = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "what": "measured modes over postures as a Gaussian process about a robot's model",
        "postures": [_posture(learned, p, joints) for p in range(len(learned.measured))],
        "mass_factors": _named(bodies, np.exp(learned.mass)),
        "hyperparameters": {
            "what": "standard deviations of logarithms (shapes: shares), and the length scale of the kernels",
            "best": _named(NAMES, np.exp(learned.best)),
            "draws_in_order_of": list(NAMES),
            "draws": np.exp(learned.draws).tolist(),
        },
    }
    with writing_whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1, allow_nan=False), encoding="utf-8")


def read_learned_postures(path: str | os.PathLike[str], robot: SpatialRobot) -> LearnedPostures:
    """Read what :func:`write_learned_postures` wrote, for the robot with which it was learned.

    Raises
    ------
    InputError
        No such file, or another robot.
    FileFormatError
        Another format, or fields that are missing or wrong.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name, or learn it with 'millfrf robot learn'")
    try:
        raw = json.loads(Path(path).read_text(encoding="utf-8"))
        content = _File.model_validate(raw)
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise FileFormatError(f"{path} is not JSON; give a file that 'millfrf robot learn' wrote") from error
    except ValidationError as error:
        raise FileFormatError(f"{path} holds no learned postures: {mistake_in_words(error, _File)}") from error
    joints, bodies = part_names(robot)
    try:
        measured = tuple(_measured(one) for one in content.postures)
        stiffness = np.log([[one.stiffness_factors[name] for name in joints] for one in content.postures])
        mass = np.log([content.mass_factors[name] for name in bodies])
        best = np.log([content.hyperparameters.best[name] for name in NAMES])
        draws = np.log(np.array(content.hyperparameters.draws, dtype=float).reshape(-1, len(NAMES)))
    except KeyError as error:
        raise InputError(f"{path} says nothing of {error.args[0]}: it was learned with another robot") from error
    except ValueError as error:
        raise FileFormatError(f"{path}: lists of unequal length ({error}); learn it anew") from error
    for one in content.postures:
        _refuse_other_robot(path, robot, one)
    pairs = tuple(
        tuple((i, mode.model_mode - 1) for i, mode in enumerate(one.modes) if mode.model_mode is not None)
        for one in content.postures
    )
    return assembled(robot, measured, pairs, (best, draws), (stiffness, mass))


def _refuse_other_robot(path: str | os.PathLike[str], robot: SpatialRobot, posture: _Posture) -> None:
    if len(posture.driven_rad_m) != int(robot.mechanism.active.sum()):
        raise InputError(f"{path} was learned with a robot of {len(posture.driven_rad_m)} driven joints; give that one")
    now = _modelled(basis_at(robot, np.array(posture.driven_rad_m))[0])
    then = np.array(posture.modelled_frequencies_hz)
    if len(now) != len(then) or np.abs(now / then - 1).max() > SAME:
        raise InputError(
            f"{path} was learned with another robot: in posture {posture.name!r} its first mode was modelled at "
            f"{then[0]:.3f} Hz, now at {now[0]:.3f} Hz; give the same robot file, or learn anew"
        )


def _modelled(basis: ModalBasis) -> Real:
    return np.sqrt(basis.squares[:6]) / (2 * np.pi)


def _posture(learned: LearnedPostures, number: int, joints: tuple[str, ...]) -> dict[str, Any]:
    one = learned.measured[number]
    numbers = dict(learned.pairs[number])
    modes = [
        {
            "frequency_hz": float(one.frequencies[i]),
            "damping_ratio": float(one.damping[i]),
            "shape": one.shapes[i].tolist(),
            "relative_errors": one.errors[i].tolist(),
            "model_mode": numbers[i] + 1 if i in numbers else None,
        }
        for i in range(len(one.frequencies))
    ]
    return {
        "name": one.name,
        "driven_rad_m": one.driven.tolist(),
        "driven_deg_m": typed_values(learned.robot.mechanism, one.driven).tolist(),
        "directions": one.directions.tolist(),
        "modelled_frequencies_hz": _modelled(basis_at(learned.robot, one.driven)[0]).tolist(),
        "stiffness_factors": _named(joints, np.exp(learned.stiffness[number])),
        "modes": modes,
    }


def _measured(one: _Posture) -> MeasuredModes:
    return MeasuredModes(
        one.name,
        np.array(one.driven_rad_m, dtype=float),
        np.array([mode.frequency_hz for mode in one.modes]),
        np.array([mode.damping_ratio for mode in one.modes]),
        np.array([mode.shape for mode in one.modes], dtype=float).reshape(len(one.modes), len(one.directions)),
        np.array([mode.relative_errors for mode in one.modes]),
        np.array(one.directions, dtype=float),
    )


def _named(names: tuple[str, ...], values: Real) -> dict[str, float]:
    return {name: float(value) for name, value in zip(names, values, strict=True)}
