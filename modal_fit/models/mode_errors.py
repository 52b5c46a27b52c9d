"""`ModeErrors`: standard errors of natural frequencies and damping ratios, each by where it comes from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


@dataclass(frozen=True)
class ModeErrors:
    """Standard errors of each mode: column 0 of the natural frequency (Hz), column 1 of the damping ratio.

    ``total^2 = max(noise, points)^2 + band^2 + terms^2``: noise is inside the scatter over the points, so that the
    larger of the two counts.

    Parameters
    ----------
    noise : (n_modes, 2)
        Standard errors from the noise of the FRF, or from the misfit where that is larger.
    points : (n_modes, 2)
        Jackknife over the responses: change of the result when single points are left out. NaN with fewer than four
        responses.
    band : (n_modes, 2)
        Root mean square change when an edge of the band moves inwards by a twentieth of the band. NaN where no edge can
        move.
    terms : (n_modes, 2)
        Root mean square change with other out-of-band terms.
    """

    noise: Real
    points: Real
    band: Real
    terms: Real

    @property
    def total(self) -> Real:
        """All of it, shape (n_modes, 2).

        Examples
        --------
        >>> one = np.array([[3.0, 0.3]])
        >>> ModeErrors(one, np.full((1, 2), np.nan), 4 * one / 3, 0 * one).total.round(3).tolist()
        [[5.0, 0.5]]
        """
        scatter = np.fmax(self.noise, self.points)
        return np.asarray(np.sqrt(scatter**2 + np.nan_to_num(self.band) ** 2 + np.nan_to_num(self.terms) ** 2))

    @property
    def frequency(self) -> Real:
        """Standard errors of the natural frequencies, Hz, shape (n_modes,)."""
        return np.asarray(self.total[:, 0])

    @property
    def damping(self) -> Real:
        """Standard errors of the damping ratios, shape (n_modes,)."""
        return np.asarray(self.total[:, 1])

    def ordered(self, order: NDArray[np.int64]) -> "ModeErrors":
        """The same for modes in another order."""
        return ModeErrors(self.noise[order], self.points[order], self.band[order], self.terms[order])
