"""FRFs that are mostly noise by their own coherence, and do not say how large their errors are."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf

from .passivity import POWERS

Real = NDArray[np.float64]

COHERENT = 0.5
"""Coherence from which a line says something of the structure; `estimate` states the band of such lines."""

KNOWN = 0.5
"""Share of a response's energy on such lines below which it is doubted."""


def incoherence_doubts(frf: Frf) -> list[str]:
    """Judge the coherence of an FRF without covariance or averages.

    The random error of a value from n averages is ``sqrt((1 - c) / (2 n c))`` of it, c being the coherence (Bendat &
    Piersol, Random Data, 4th ed., section 9.2.4). Where n is known, or a covariance, fit and limits carry that error;
    where it is not, nothing that is made of the FRF knows that it is mostly noise.

    Parameters
    ----------
    frf
        Lines that are valid and in its stated band are judged, weighted by the energy of the mobility.

    Returns
    -------
    list of str
        One doubt with the responses whose energy lies mostly on lines of a coherence below a half; empty where there
        is none, or where nothing is known of the coherence.
    """
    coherence = _coherence(frf)
    if coherence is None or frf.entry_variance() is not None:
        return []
    low, high = frf.band or (0.0, np.inf)
    f = frf.frequencies
    inside = frf.valid & (f > 0) & (f >= low) & (f <= high)
    weight = np.where(f > 0, f, 1.0) ** (2 * POWERS.get(frf.quantity, 0))
    energy = (np.abs(frf.values) ** 2 * weight[:, None, None])[inside]
    known = coherence[inside]
    energy = np.where(np.isnan(known), 0.0, energy)
    total = energy.sum(axis=(0, 2))
    coherent = (energy * (known >= COHERENT)).sum(axis=(0, 2))
    poor = [p for p in range(len(frf.responses)) if total[p] > 0 and coherent[p] < KNOWN * total[p]]
    if not poor:
        return []
    share = 100 * (1 - coherent[poor].sum() / total[poor].sum())
    names = ", ".join(frf.responses[p] for p in poor)
    return [
        f"{names}: {share:.0f} % of the motion lies on lines whose coherence is below {COHERENT:g} (median "
        f"{np.nanmedian(known[:, poor]):.2g}), and the FRF gives neither a covariance nor averages: what is made of "
        "it does not know its errors; average more, or give the averages and the coherence of each entry"
    ]


def _coherence(frf: Frf) -> Real | None:
    """Give the coherence of each entry, (n_frequencies, n_responses, n_excitations): multiple, else ordinary."""
    if frf.multiple_coherence is not None:
        return np.broadcast_to(frf.multiple_coherence[:, :, None], frf.values.shape)
    return frf.coherence
