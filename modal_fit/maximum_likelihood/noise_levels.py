"""Noise on responses and on forces, told apart by how the structure passes the second."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

_SIGNIFICANT = 3.0  # standard errors


@dataclass(frozen=True)
class NoiseLevels:
    """Variance of the noise on a Fourier line, per test and channel.

    Parameters
    ----------
    response : (n_tests, n_responses), unit^2
        Noise variance of each response.
    excitation : (n_tests, n_excitations), unit^2
        Noise variance of each excitation.
    """

    response: NDArray[np.float64]
    excitation: NDArray[np.float64]

    def covariance(self, frf: NDArray[np.complex128], test: NDArray[np.int64]) -> NDArray[np.complex128]:
        """``V = diag(response) + H diag(excitation) H^H`` of the equation error ``X - H F`` on every line."""
        passed = np.einsum("kpq,kq,kuq->kpu", frf, self.excitation[test], frf.conj(), optimize=True)
        diagonal = np.einsum("kp,pu->kpu", self.response[test], np.eye(frf.shape[1]))
        return np.asarray(passed + diagonal)


def flat_noise(error: NDArray[np.complex128], test: NDArray[np.int64], n_excitations: int) -> NoiseLevels:
    """All of the error taken as flat noise on the responses; ``error`` (n_lines, n_responses)."""
    n_tests = int(test.max()) + 1
    response = np.array([np.mean(np.abs(error[test == number]) ** 2, axis=0) for number in range(n_tests)])
    return NoiseLevels(response, np.zeros((n_tests, n_excitations)))


def noise_levels(
    error: NDArray[np.complex128],
    frf: NDArray[np.complex128],
    test: NDArray[np.int64],
    n_tests: int,
    n_unknowns: int,
) -> NoiseLevels:
    """Estimate noise variances from the equation error ``X - H F`` of a fitted model.

    On each line ``E|error_p|^2 = v_p + sum_q |H_pq|^2 w_q``: response noise is flat over the band, force
    noise comes out shaped by the structure. Non-negative least squares, reweighted by the squared mean that an
    exponentially distributed power has (Pintelon & Schoukens, System Identification, 2nd ed., chapter 9).

    Parameters
    ----------
    error : (n_lines, n_responses)
        Equation error of the fitted model on each line.
    frf : (n_lines, n_responses, n_excitations)
        FRF of the fitted model on each line.
    test : (n_lines,), int
        Number of the test that each line comes from.
    n_tests
        Number of tests.
    n_unknowns
        Number of real unknowns already fitted: they took their share of the error.
    """
    n_lines, n_responses = error.shape
    shrink = 1 - n_unknowns / (2 * n_lines * n_responses)
    power = np.abs(error) ** 2 / max(shrink, 0.1)
    gain = np.abs(frf) ** 2
    response = np.empty((n_tests, n_responses))
    excitation = np.empty((n_tests, frf.shape[2]))
    for number in range(n_tests):
        mine = test == number
        solved = _variance_components(power[mine], gain[mine])
        response[number], excitation[number] = solved[:n_responses], solved[n_responses:]
    return NoiseLevels(response, excitation)


def _variance_components(power: NDArray[np.float64], gain: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve for (v_1..v_p, w_1..w_q) of one test; a force noise that does not show is taken as zero."""
    n_lines, n_responses, n_excitations = gain.shape
    flat = np.broadcast_to(np.eye(n_responses), (n_lines, n_responses, n_responses))
    design = np.concatenate([flat, gain], axis=2).reshape(-1, n_responses + n_excitations)
    observed = power.reshape(-1)
    mean = power.mean(axis=0)
    kept = np.arange(n_responses + n_excitations)
    while True:
        solved, errors = _reweighted(design[:, kept], observed, np.tile(mean, n_lines))
        force = kept >= n_responses
        weakest = np.argmin(np.where(force, solved / errors, np.inf))
        if not force.any() or solved[weakest] > _SIGNIFICANT * errors[weakest]:
            break
        kept = np.delete(kept, weakest)
    levels = np.zeros(n_responses + n_excitations)
    levels[kept] = solved
    levels[:n_responses] = np.maximum(levels[:n_responses], 1e-6 * mean)
    return levels


def _reweighted(
    design: NDArray[np.float64], observed: NDArray[np.float64], expected: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Non-negative least squares with weights 1 / mean^2, and standard errors of the components."""
    scale = np.linalg.norm(design, axis=0)
    floor = 1e-3 * expected
    for _ in range(8):
        weighted = design / scale / expected[:, None]
        solved, _ = nnls(weighted, observed / expected)
        expected = np.maximum(design @ (solved / scale), floor)
    weighted = design / scale / expected[:, None]
    variance = np.diag(np.linalg.pinv(weighted.T @ weighted))
    return solved / scale, np.sqrt(variance) / scale
