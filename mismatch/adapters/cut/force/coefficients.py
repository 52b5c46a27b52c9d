"""`Belief`: force coefficients and what a laboratory is usually off; they are refitted before a cause is named."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from foundation import InputError

Real = NDArray[np.float64]

COEFFICIENT_NAMES = ("ktc_pa", "krc", "kac", "kte_n_per_m", "kre_n_per_m", "kae_n_per_m")


@dataclass(frozen=True)
class Belief:
    """The coefficients of a cutting file and one standard deviation of what they are off.

    ``ktc = ktc0 exp(e u_1)``, ``krc = krc0 + e max(|krc0|, 0.1) u_2``, ``kte = kte0 + e max(kte0, ktc0 f) u_4``, and
    alike the others: the deviations u are standard normal.

    Parameters
    ----------
    process
        Cutting process as its file states it.
    error
        One standard deviation e of what a coefficient is off, a share.

    Raises
    ------
    InputError
        The error is not a positive share.
    """

    process: MillingProcess
    error: float = 0.15

    def __post_init__(self) -> None:
        if not 0 < self.error < 1:
            raise InputError(f"coefficients off by {self.error!r}: give a share between 0 and 1, for example 0.15")

    @property
    def scales(self) -> Real:
        """One standard deviation of each coefficient, (6,); that of ``ktc`` is relative."""
        one = self.process
        edge = one.ktc * one.feed_per_tooth
        shares = [1.0, max(abs(one.krc), 0.1), max(abs(one.kac), 0.1)]
        return self.error * np.array(shares + [max(k, edge) for k in (one.kte, one.kre, one.kae)])

    @property
    def lowest(self) -> Real:
        """Deviations below which an edge coefficient would be negative, (6,)."""
        edges = np.array([self.process.kte, self.process.kre, self.process.kae])
        return np.concatenate([np.full(3, -40.0), -edges / self.scales[3:] - 1e-9])

    def process_at(self, deviations: Real) -> MillingProcess:
        """The process with its coefficients moved.

        Parameters
        ----------
        deviations : (6,)
            Deviations u, in standard deviations.

        Examples
        --------
        >>> slot = MillingProcess(2, 0.01, np.pi / 2, 1e8, 0.3, 0.0, 0.0, np.pi, 1e-4)
        >>> moved = Belief(slot, 0.1).process_at(np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0]))
        >>> round(moved.krc, 6)
        0.33
        """
        one, moved = self.process, self.scales * deviations
        return replace(
            one,
            ktc=one.ktc * float(np.exp(moved[0])),
            krc=one.krc + float(moved[1]),
            kac=one.kac + float(moved[2]),
            kte=max(one.kte + float(moved[3]), 0.0),
            kre=max(one.kre + float(moved[4]), 0.0),
            kae=max(one.kae + float(moved[5]), 0.0),
        )

    def told(self, deviations: Real, errors: Real) -> tuple[dict[str, float], dict[str, float]]:
        """Coefficients and standard errors by the names of the cutting file, SI.

        Parameters
        ----------
        deviations : (6,)
            Deviations u, in standard deviations.
        errors : (6,)
            Standard errors of the deviations.
        """
        moved = self.process_at(deviations)
        values = (moved.ktc, moved.krc, moved.kac, moved.kte, moved.kre, moved.kae)
        spread = self.scales * errors * np.array([moved.ktc, 1.0, 1.0, 1.0, 1.0, 1.0])
        return dict(zip(COEFFICIENT_NAMES, values, strict=True)), dict(
            zip(COEFFICIENT_NAMES, map(float, spread), strict=True)
        )
