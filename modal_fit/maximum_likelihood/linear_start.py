"""Given poles, everything else is linear: full residue matrices, out-of-band terms and transients."""

import numpy as np
from numpy.typing import NDArray

from .likelihood_model import LikelihoodModel, Setting

Complex = NDArray[np.complex128]


def linear_start(poles: Complex, setting: Setting, *, transients: bool = True) -> LikelihoodModel:
    """Least-squares unknowns for fixed ``poles`` (rad/s), with residues reduced to rank one.

    Responses of one kind have the same regressors, so one factorisation serves them all. The residue
    matrices come out full and are cut to rank one by their singular vectors, which are the right and left vectors.
    """
    spectra = setting.spectra
    n_modes, n_excitations, n_outside = len(poles), spectra.excitation.shape[1], len(setting.basis)
    n_tests = spectra.n_tests if transients else 0
    parts = []
    for derivative in np.unique(spectra.derivative):
        mine = spectra.derivative == derivative
        parts.append((mine, _solve(regressors(poles, setting, int(derivative), n_tests), spectra.response[:, mine])))
    solution = np.empty((len(parts[0][1]), spectra.response.shape[1]))
    for mine, part in parts:
        solution[:, mine] = part
    ends = np.cumsum([2 * n_modes * n_excitations, n_outside * n_excitations])
    residues, outside, free = np.split(solution, ends)
    residues = residues.reshape(n_modes, n_excitations, 2, -1)
    outside = np.moveaxis(outside.reshape(n_outside, n_excitations, -1), 1, 2)
    free = free.reshape(n_tests, n_modes + len(setting.powers), 2, spectra.response.shape[1])
    decays = free[:, :, 0] + 1j * free[:, :, 1]
    matrices = np.moveaxis(residues[:, :, 0] + 1j * residues[:, :, 1], 1, 2)
    return _rank_one(poles, matrices, outside, decays[:, :n_modes], decays[:, n_modes:])


def regressors(poles: Complex, setting: Setting, derivative: int, n_tests: int) -> Complex:
    """Columns of the linear problem, shape (n_lines, n_unknowns), for real unknowns.

    First the residues, mode by mode and excitation by excitation (real and imaginary part), then the out-of-band terms,
    then the transients of ``n_tests`` tests.
    """
    spectra = setting.spectra
    s, force = spectra.s, spectra.excitation
    factor = s**derivative
    plus = factor[:, None] / (s[:, None] - poles)
    minus = factor[:, None] / (s[:, None] - poles.conj())
    residues = np.einsum("krc,kq->krqc", np.stack([plus + minus, 1j * (plus - minus)], axis=2), force)
    outside = np.einsum("nk,kq->knq", factor * setting.basis, force)
    member = (spectra.test[:, None] == np.arange(n_tests)).astype(float)
    free = np.concatenate([plus, setting.powers.T], axis=1)
    transients = np.einsum("kt,kn,c->ktnc", member, free, np.array([1, 1j]))
    n_lines = len(s)
    blocks = [block.reshape(n_lines, -1) for block in (residues, outside)]
    if n_tests:
        blocks.append(transients.reshape(n_lines, -1))
    return np.concatenate(blocks, axis=1)


def _solve(regressors: Complex, response: Complex) -> NDArray[np.float64]:
    """Real least squares of a complex equation, columns scaled to unit length."""
    design = np.concatenate([regressors.real, regressors.imag])
    target = np.concatenate([response.real, response.imag])
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    return np.asarray(np.linalg.lstsq(design / scale, target, rcond=1e-12)[0] / scale[:, None])


def _rank_one(
    poles: Complex, matrices: Complex, outside: NDArray[np.float64], decays: Complex, smooth: Complex
) -> LikelihoodModel:
    """Cut residue matrices to their leading singular pair and refer the transients to the right vectors."""
    u, sigma, vh = np.linalg.svd(matrices)
    root = np.sqrt(sigma[:, :1])
    right, left = u[:, :, 0] * root, vh[:, 0] * root
    length = np.sum(np.abs(right) ** 2, axis=1)
    transient = np.einsum("trp,rp->tr", decays, right.conj()) / np.where(length > 0, length, 1.0)
    return LikelihoodModel(
        np.asarray(poles, dtype=complex), right, left, np.ascontiguousarray(outside), transient, smooth
    )
