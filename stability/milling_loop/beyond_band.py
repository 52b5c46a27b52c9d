"""A fitted model beyond its band: terms at fixed poles hold inside the band only."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel, Residuals

N_LINES = 400
AROUND = 0.2
"""Distance to which a model without a stated band holds beyond its lowest and highest mode, as a share of them."""


def with_residual_flexibility(model: ModalModel) -> ModalModel:
    """The model as lobes take it: one residual flexibility in place of the out-of-band terms of its fit.

    ``R[p, q] = mean over the band of Re(out-of-band terms)``. A fit puts poles of its own choice beyond the band, so
    that their values, slopes and curvatures match what modes there leave inside. Beyond the band they are resonances
    that nobody measured, and the harmonics of the tooth passing meet them: a true limit of 2 mm became none, or a
    twentieth. A constant carries the mean inside the band and no resonance outside (Ewins, Modal Testing, 2nd ed.,
    section 4.5). The modes stay as they are.

    Parameters
    ----------
    model
        Any modal model; one without terms at fixed poles comes back as it is.

    Examples
    --------
    >>> pole = np.array([-1 + 600j])
    >>> outside = Residuals(np.zeros((1, 1)), np.zeros((1, 1)), pole, np.array([[[-3e-4j]]]))
    >>> mode = ModalModel(
    ...     np.array([-2 + 100j]), np.array([[-1e-4j]]), np.ones((1, 1)) + 0j, ("T:+X",), ("T:+X",),
    ...     residuals=outside, band=(10.0, 22.0),
    ... )
    >>> told = with_residual_flexibility(mode).residuals
    >>> told.poles, told.upper.round(8).tolist()
    (None, [[1.03e-06]])
    """
    if model.residuals is None or model.residuals.poles is None:
        return model
    upper = model.residuals.receptance(_lines(model)).real.mean(axis=0)
    return replace(model, residuals=Residuals(upper, np.zeros_like(upper)))


def lost_inside(model: ModalModel) -> float:
    """How much of the FRF in the modes' half-power bands :func:`with_residual_flexibility` leaves out, as a share.

    Large where a mode stands just outside the band: then it shapes the FRF inside, and belongs into the fit.
    """
    if model.residuals is None or model.residuals.poles is None:
        return 0.0
    s = _lines(model)
    outside = model.residuals.receptance(s)
    left_out = np.linalg.norm(outside - outside.real.mean(axis=0), axis=(1, 2))
    size = np.linalg.norm(model.at(s), axis=(1, 2))
    axis, natural = s.imag / (2 * np.pi), model.natural_frequencies[:, None]
    resonant = (np.abs(axis - natural) <= model.damping_ratios[:, None] * natural).any(axis=0)
    if not resonant.any():
        return 0.0
    return float(np.sqrt(np.sum(left_out[resonant] ** 2) / np.sum(size[resonant] ** 2)))


def _lines(model: ModalModel) -> NDArray[np.complex128]:
    """Lines ``2 pi i f`` over the band, or about the modes where none is stated."""
    natural = model.natural_frequencies
    low, high = model.band or ((1 - AROUND) * natural.min(), (1 + AROUND) * natural.max())
    return np.asarray(2j * np.pi * np.linspace(low, high, N_LINES))
