"""Identification of a planar robot from FRFs at its tip, or from first natural frequencies alone."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError, Real

from ..planar import TIP_IN_PLANE, PlanarRobot, rigid_matrices, tip_jacobian
from .parameter_search import Identification, identify

BOUNDS = {"masses": (15.0, 125.0), "stiffness": (1e3, 1e7), "lengths": (0.2, 1.1), "damping_ratios": (1e-3, 0.3)}
"""Of Chen et al. 2026, Eq. 21; those of the damping ratios are ours, the paper prints none."""

_LETTERS = {"masses": "m", "stiffness": "k", "lengths": "a", "damping_ratios": "zeta"}


def identify_from_frfs(
    robot: PlanarRobot,
    measured: Sequence[tuple[Real, Frf]],
    free: Sequence[str] = ("masses", "stiffness", "lengths"),
    *,
    bounds: Mapping[str, tuple[float, float]] = BOUNDS,
    search: bool = True,
    seed: int = 0,
) -> Identification:
    """Fit the rigid-link model to receptances, relative deviation on every valid line (Chen et al. 2026, Eq. 21).

    Parameters
    ----------
    robot
        Robot that gives the values of what is not free, and the start where ``search`` is False.
    measured
        Joint angles (rad) and the receptance there, over any of the tip's degrees of freedom in the plane.
    free
        Parameters to fit, among ``masses``, ``stiffness``, ``lengths``, ``damping_ratios``.
    bounds
        Lowest and highest value of each parameter, by the same names, in SI units.
    search
        Whether the bounds are searched globally first.

    Raises
    ------
    InputError
        An FRF that is no receptance of the tip in the plane, or an unknown name.
    """
    cases = [(angles, frf, *_indices(frf)) for angles, frf in measured]

    def residuals(trial: PlanarRobot) -> Real:
        parts = []
        for angles, frf, rows, columns in cases:
            model = _receptance(trial, angles, frf.frequencies[frf.valid])
            given = frf.values[frf.valid]
            ratio = (model[:, rows][:, :, columns] - given) / np.abs(given)
            parts += [ratio.real.ravel(), ratio.imag.ravel()]
        return np.concatenate(parts)

    return _identify(robot, residuals, free, bounds, search, seed)


def identify_from_frequencies(
    robot: PlanarRobot,
    measured: Sequence[tuple[Real, float]],
    free: Sequence[str] = ("masses", "stiffness", "lengths"),
    *,
    relative_error: float = 0.01,
    bounds: Mapping[str, tuple[float, float]] = BOUNDS,
    search: bool = True,
    seed: int = 0,
) -> Identification:
    """The same from the first natural frequency (Hz) at several poses, known to ``relative_error``.

    Raises
    ------
    InputError
        An unknown name in ``free``.
    """

    def residuals(trial: PlanarRobot) -> Real:
        first = [_first_frequency(trial, angles) for angles, _ in measured]
        return np.array([f / given - 1 for f, (_, given) in zip(first, measured, strict=True)]) / relative_error

    return _identify(robot, residuals, free, bounds, search, seed)


def _first_frequency(robot: PlanarRobot, angles: Real) -> float:
    mass, stiffness = rigid_matrices(robot, angles)
    return float(np.sqrt(scipy.linalg.eigvalsh(stiffness, mass)[0]) / (2 * np.pi))


def _receptance(robot: PlanarRobot, angles: Real, frequencies: Real) -> NDArray[np.complex128]:
    """Compute ``rigid_model(...).receptance(...)`` without its checks: the search calls it often."""
    mass, stiffness = rigid_matrices(robot, angles)
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    tip = tip_jacobian(robot, angles) @ shapes
    omega = 2 * np.pi * frequencies[:, None]
    modes = 1 / (squares - omega**2 + 2j * robot.damping_ratios * np.sqrt(squares) * omega)
    return np.asarray((modes[:, None, :] * tip) @ tip.T)


def apply_identified(robot: PlanarRobot, found: Identification) -> PlanarRobot:
    """The robot with the identified values; flexible sections keep their stiffness."""
    named = dict(zip(found.names, found.values, strict=True))
    changes: dict[str, Any] = {}
    for field, letter in _LETTERS.items():
        column = np.array(getattr(robot, field), dtype=float)
        for index in range(len(column)):
            column[index] = named.get(f"{letter}{index + 1}", column[index])
        changes[field] = column
    return replace(robot, **changes)


def _identify(
    robot: PlanarRobot,
    residuals: Callable[[PlanarRobot], Real],
    free: Sequence[str],
    bounds: Mapping[str, tuple[float, float]],
    search: bool,
    seed: int,
) -> Identification:
    unknown = [name for name in free if name not in _LETTERS]
    if unknown or not free:
        raise InputError(f"cannot identify {', '.join(unknown) or 'nothing'}; use {', '.join(_LETTERS)}")
    n_links = len(robot.lengths)
    names = [f"{_LETTERS[name]}{index + 1}" for name in free for index in range(n_links)]
    lower, upper = (np.repeat([bounds[name][side] for name in free], n_links) for side in (0, 1))
    start = np.concatenate([getattr(robot, name) for name in free])

    def of_values(values: Real) -> Real:
        columns = dict(zip(free, np.split(values, len(free)), strict=True))
        trial = PlanarRobot(
            columns.get("lengths", robot.lengths),
            columns.get("masses", robot.masses),
            columns.get("stiffness", robot.stiffness),
            columns.get("damping_ratios", robot.damping_ratios),
        )
        return residuals(trial)

    return identify(of_values, names, lower, upper, start=None if search else start, seed=seed)


def _indices(frf: Frf) -> tuple[list[int], list[int]]:
    known = set(TIP_IN_PLANE)
    strange = [name for name in (*frf.responses, *frf.excitations) if name not in known]
    if strange or frf.quantity != "receptance":
        raise InputError(
            f"identification in the plane takes a receptance over {', '.join(TIP_IN_PLANE)}; "
            f"this is a {frf.quantity} over {', '.join(strange) or 'them'}"
        )
    return [TIP_IN_PLANE.index(name) for name in frf.responses], [TIP_IN_PLANE.index(n) for n in frf.excitations]
