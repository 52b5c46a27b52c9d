"""Random structures with errors, and an integration of the cut in time that shares no code with the solvers."""

from dataclasses import dataclass, replace
from math import pi

import numba
import numpy as np
from numpy.typing import NDArray

from millfrf.core import TIP
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

Real = NDArray[np.float64]
RPM = pi / 30
STEPS = 240
"""A tooth period; the immersion is a whole number of them, so that no step lies across an entry or an exit."""


@dataclass(frozen=True)
class Case:
    """An estimate with its errors, the truth drawn from them, and speeds to look at (rad/s)."""

    model: ModalModel
    cut: MillingProcess
    true_model: ModalModel
    true_cut: MillingProcess
    speeds: Real
    max_depth: float


def random_case(seed: int) -> Case:
    """One to three modes with vectors that need not be reciprocal; slot to a/D .05, two to four teeth.

    Errors: frequencies 0.1 to 0.5 %, damping 3 to 10 %, vectors 1 to 4 %, K_tc 2 to 8 %, k_rc and k_ac 0.02.
    """
    rng = np.random.default_rng(seed)
    count, teeth = int(rng.integers(1, 4)), int(rng.integers(2, 5))
    natural = 2 * pi * np.sort(rng.uniform(15, 60) * np.exp(np.cumsum(rng.uniform(0.1, 0.7, count))))
    zeta = rng.uniform(0.015, 0.06, count)
    poles = natural * (-zeta + 1j * np.sqrt(1 - zeta**2))
    shape = rng.standard_normal((count, 3))
    right = shape / np.linalg.norm(shape, axis=1)[:, None] / (2j * poles.imag * rng.uniform(5, 20, count))[:, None]
    left = (shape + 0.1 * rng.standard_normal((count, 3))) / np.linalg.norm(shape, axis=1)[:, None] + 0j
    share = [rng.uniform(0.001, 0.005), rng.uniform(0.03, 0.10), rng.uniform(0.01, 0.04)]
    sizes = [share[1] * -poles.real, share[0] * natural]
    sizes += [share[2] * np.abs(part).max(axis=1).repeat(3) for part in (right, right, left, left)]
    packed = [poles.real, poles.imag, right.real, right.imag, left.real, left.imag]
    off = [array.ravel() + size * rng.standard_normal(array.size) for array, size in zip(packed, sizes, strict=True)]
    model = ModalModel(poles, right, left, TIP, TIP, covariance=np.diag(np.concatenate(sizes) ** 2))
    truth = ModalModel(
        off[0] + 1j * off[1],
        (off[2] + 1j * off[3]).reshape(count, 3),
        (off[4] + 1j * off[5]).reshape(count, 3),
        TIP,
        TIP,
    )
    pitch = 2 * pi / teeth
    width = (
        min(int(rng.choice([STEPS // 6, STEPS // 2, STEPS, 3 * STEPS // 2])), int(STEPS * teeth / 2)) / STEPS * pitch
    )
    start = 0.0 if rng.random() < 0.5 else pi - width
    errors = {"ktc_std": rng.uniform(0.02, 0.08) * 3e8, "krc_std": 0.02, "kac_std": 0.02}
    cut = MillingProcess(teeth, 0.02, pi / 2, 3e8, 0.3, 0.2, start, start + width, 1e-4, **errors)
    drawn = rng.standard_normal(3) * np.array(cut.coefficient_errors)
    true_cut = replace(cut, ktc=cut.ktc + drawn[0], krc=cut.krc + drawn[1], kac=cut.kac + drawn[2])
    tooth = natural[0] / teeth * rng.uniform(0.4, 1.2)
    return Case(model, cut, truth, true_cut, np.linspace(tooth, 1.6 * tooth, 25), 0.05)


def growth(model: ModalModel, cut: MillingProcess, depth: float, speed: float, teeth: int = 600) -> float:
    """Factor a tooth period by which a small deviation grows; Runge-Kutta on modal coordinates, own force law."""
    period = 2 * pi / (cut.teeth * speed)
    rows = np.concatenate([2 * model.right.real, -2 * model.right.imag]).T  # x = rows (Re q, Im q)
    columns = np.concatenate([model.left.real, model.left.imag])
    decay, turn = np.diag(model.poles.real), np.diag(model.poles.imag)
    state = np.block([[decay, -turn], [turn, decay]])
    lag = 2 * depth * np.tan(cut.helix_angle) / cut.diameter
    forces = [_alpha(cut, step, lag) for step in range(STEPS)]
    matrices = np.array([[depth * cut.ktc * columns @ alpha @ rows for alpha in step] for step in forces])
    substeps = int(np.ceil(np.abs(model.poles).max() * period / STEPS / 0.25))
    sizes = np.cumsum(_march(state, matrices, period / STEPS, substeps, teeth))[teeth // 3 :]
    return float(np.exp(np.polyfit(np.arange(len(sizes)), sizes, 1)[0]))


def _alpha(cut: MillingProcess, step: int, lag: float) -> list[Real]:
    """Force over chip displacement at begin, middle and end of a step, engagement that of its middle.

    A helical edge is cut into slices whose lag behind the tip rises to ``lag`` (rad).
    """
    pitch, slices = 2 * pi / cut.teeth, 1 if lag == 0 else 32
    result = []
    for place in (0.0, 0.5, 1.0):
        total = np.zeros((3, 3))
        for behind in lag * (np.arange(slices) + 0.5) / slices:
            for tooth in range(cut.teeth):
                middle = (cut.start_angle + (step + 0.5) / STEPS * pitch + tooth * pitch - behind) % (2 * pi)
                phi = middle + (place - 0.5) / STEPS * pitch
                if cut.start_angle < middle < cut.exit_angle:
                    normal = np.array([np.sin(phi), np.cos(phi), 0.0])
                    tangent = np.array([np.cos(phi), -np.sin(phi), 0.0])
                    push = -tangent - cut.krc * normal - cut.kac * np.array([0.0, 0.0, 1.0])
                    total += np.outer(push, normal) / slices
        result.append(total)
    return result


def helical(case: Case, angle: float = 0.6) -> Case:
    """The same case with helical edges (rad)."""
    cut, true_cut = (replace(each, helix_angle=angle) for each in (case.cut, case.true_cut))
    return replace(case, cut=cut, true_cut=true_cut)


@numba.njit  # type: ignore[untyped-decorator]
def _march(state: Real, matrices: Real, step: float, substeps: int, teeth: int) -> Real:
    """Classical Runge-Kutta of order 4 with the state of a period ago, by cubics; log of each tooth's growth."""
    steps, size = matrices.shape[0], state.shape[0]
    before, now = np.zeros((steps + 1, size)), np.zeros((steps + 1, size))
    z = np.sin(np.arange(1, size + 1) * 1.7) + 0.3
    growths = np.empty(teeth)
    for tooth in range(teeth):
        now[0] = z
        for i in range(steps):
            k = min(max(i - 1, 0), steps - 3)
            for part in range(substeps):
                h = step / substeps
                slopes = np.zeros((4, size))
                for stage in range(4):
                    place = (part + (0.0, 0.5, 0.5, 1.0)[stage]) / substeps
                    u = i - k + place
                    old = (
                        -(u - 1) * (u - 2) * (u - 3) / 6 * before[k]
                        + u * (u - 2) * (u - 3) / 2 * before[k + 1]
                        - u * (u - 1) * (u - 3) / 2 * before[k + 2]
                        + u * (u - 1) * (u - 2) / 6 * before[k + 3]
                    )
                    a, b, c = matrices[i, 0], matrices[i, 1], matrices[i, 2]
                    m = a + place * (4 * b - 3 * a - c) + place * place * (2 * a + 2 * c - 4 * b)
                    at = z.copy()
                    if stage == 3:
                        at += h * slopes[2]
                    elif stage > 0:
                        at += 0.5 * h * slopes[stage - 1]
                    slopes[stage] = state @ at + m @ (at - old)
                z = z + h / 6 * (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3])
            now[i + 1] = z
        size_now = np.sqrt(np.sum(now * now))
        growths[tooth] = np.log(size_now)
        now /= size_now
        z = z / size_now
        before[:] = now
    return growths
