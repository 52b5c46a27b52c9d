"""Poles of an FRF by weighted nonlinear least squares, with their errors: independent of the project's fits."""

import numpy as np
from scipy.optimize import least_squares


def correlation(lines: int, time_constant: float | None, spacing: float) -> np.ndarray:
    """Of white noise under ``exp(-t / tau)`` between lines ``spacing`` (Hz) apart: its square's transform."""
    if time_constant is None:
        return np.eye(lines)
    apart = np.subtract.outer(np.arange(lines), np.arange(lines))
    return np.asarray(1 / (1 + 1j * np.pi * apart * spacing * time_constant))


def fitted_poles(
    s: np.ndarray, values: np.ndarray, deviation: np.ndarray, start: np.ndarray, order: int, between: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Poles of ``s^order (sum R / (s - p) + conjugate)`` in columns of values, and the covariance of (re, im).

    Lines are weighed as if their noise were independent; the covariance is that of this estimate under noise with the
    correlation ``between`` lines, (n_lines, n_lines).

    Parameters
    ----------
    s : (n_lines,)
        Where the values stand; with an exponential window off the imaginary axis.
    values, deviation : (n_lines, n_entries)
    start : (n_modes,)
    """

    def misfit(numbers: np.ndarray) -> np.ndarray:
        poles = numbers[: len(start)] + 1j * numbers[len(start) :]
        terms, mirrored = 1 / (s[:, None] - poles), 1 / (s[:, None] - poles.conj())
        basis = s[:, None] ** order * np.hstack([terms + mirrored, 1j * (terms - mirrored)])
        left = []
        for column in range(values.shape[1]):
            weight = 1 / deviation[:, column]
            table = np.vstack([(basis * weight[:, None]).real, (basis * weight[:, None]).imag])
            aim = np.concatenate([(values[:, column] * weight).real, (values[:, column] * weight).imag])
            left.append(aim - table @ np.linalg.lstsq(table, aim, rcond=None)[0])
        return np.sqrt(2) * np.concatenate(left)  # deviation is of the complex value: half of it in each part

    scale = np.tile(np.abs(start.real), 2)
    result = least_squares(misfit, np.concatenate([start.real, start.imag]), x_scale=scale, xtol=1e-14, ftol=1e-14)
    inverse = np.linalg.inv(result.jac.T @ result.jac)
    scatter, n = np.zeros((len(result.x), len(result.x))), len(s)
    for column in range(values.shape[1]):
        both = result.jac[2 * n * column : 2 * n * (column + 1)]
        slope = both[:n] + 1j * both[n:]
        scatter += np.real(slope.conj().T @ between @ slope)
    return result.x[: len(start)] + 1j * result.x[len(start) :], inverse @ scatter @ inverse
