"""What a laboratory measures with the robot at rest: hammer FRFs of tip and housing, and a model of each pose."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, FrfCovariance, write_frf
from millfrf.core import HOUSING, TIP
from modal_fit import ModalModel, write_modal_model
from replay_data import select

from .recordings import Laboratory
from .schedule import pose_name
from .true_robot import Condition

Real = NDArray[np.float64]

LINES = np.arange(5.0, 150.0 + 0.125, 0.25)
"""Frequencies of the hammer FRFs, Hz: taps 4 s apart."""

HAMMER_NOISE = 0.01
"""Noise of a hammer FRF over the root mean square of its row, after averaging."""

BAND = (8.0, 95.0)
"""Band of the models at rest, Hz."""

OFF = (0.002, 0.04, 0.02)
"""Relative errors of the laboratory's own models: frequency, damping ratio, shape."""


def write_taps(laboratory: Laboratory, pose: int, folder: Path, seed: int) -> None:
    """Hammer FRFs ``<pose>_tip.h5`` and ``<pose>_housing.h5``, accelerance with its covariance."""
    structure = laboratory.true.structure(laboratory.postures[pose], Condition(idle=True))
    generator = np.random.default_rng([seed, pose, 1])
    for place, responses in (("tip", TIP), ("housing", HOUSING)):
        model = select(structure, responses, TIP)
        write_frf(folder / f"{pose_name(pose)}_{place}.h5", _tapped(model, generator))


def _tapped(model: ModalModel, generator: np.random.Generator) -> Frf:
    omega = 2 * np.pi * LINES[:, None, None]
    exact = -(omega**2) * model.receptance(LINES)
    size = HAMMER_NOISE * np.sqrt(np.mean(np.abs(exact) ** 2, axis=(0, 2)))
    noise = generator.standard_normal((2, *exact.shape)) * size[:, None] / np.sqrt(2)
    n_lines, n_excitations = len(LINES), exact.shape[2]
    covariance = FrfCovariance(
        np.tile(np.diag(size**2).astype(complex), (n_lines, 1, 1)),
        np.tile(np.eye(n_excitations, dtype=complex), (n_lines, 1, 1)),
    )
    return Frf(
        LINES,
        exact + noise[0] + 1j * noise[1],
        model.responses,
        model.excitations,
        "accelerance",
        "m/s^2/N",
        np.ones(n_lines, dtype=bool),
        covariance=covariance,
        band=(float(LINES[0]), float(LINES[-1])),
    )


def write_idle_model(laboratory: Laboratory, pose: int, folder: Path, seed: int) -> None:
    """Model of the robot at rest, ``<pose>.json``, at the housing, with the errors of a laboratory's own fit."""
    structure = laboratory.true.structure(laboratory.postures[pose], Condition(idle=True))
    generator = np.random.default_rng([seed, pose, 2])
    own = select(structure, HOUSING, TIP)
    low = own.natural_frequencies < BAND[1]
    count = int(low.sum())
    natural = 2 * np.pi * own.natural_frequencies[low] * (1 + OFF[0] * generator.standard_normal(count))
    ratios = own.damping_ratios[low] * (1 + OFF[1] * generator.standard_normal(count))
    shape = own.right[low] * (1 + OFF[2] * generator.standard_normal(own.right[low].shape))
    poles = natural * (-ratios + 1j * np.sqrt(1 - ratios**2))
    model = ModalModel(poles, shape, own.left[low], own.responses, own.excitations)
    write_modal_model(folder / f"{pose_name(pose)}.json", replace(model, band=BAND))
