"""Series of a campaign with normal scatter, without files: what drift and outliers are judged by."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from millfrf.campaign.results.regression import Labels
from millfrf.campaign.results.trends import Series

Real = NDArray[np.float64]


class Simulated:
    """A campaign of series with normal scatter, sets in the order of poses and sessions."""

    def __init__(self, seed: int, poses: int = 6, sessions: int = 4, repeats: int = 2, modes: int = 2) -> None:
        self.rng = np.random.default_rng(seed)
        n = poses * sessions * repeats
        self.pose = np.repeat(np.arange(poses), sessions * repeats)
        self.session = np.tile(np.repeat(np.arange(sessions) + 1.0, repeats), poses)
        self.temperature = 20 + self.rng.normal(0, 2, n)
        self.modes = modes

    def labels(self, *names: str) -> Labels:
        columns: Mapping[str, Real] = {"session": self.session, "temperature_c": self.temperature}
        return Labels({name: columns[name] for name in names}, {})

    def series(
        self, added: Mapping[tuple[int, int], Real] | None = None, scatter: float = 1e-3, stated: float = 5e-4
    ) -> list[Series]:
        """Frequencies with the scatter that repeats have; ``added`` by pose and mode, to the logarithms of all sets."""
        result = []
        for p in np.unique(self.pose):
            rows = np.flatnonzero(self.pose == p)
            for mode in range(1, self.modes + 1):
                errors = stated * np.exp(self.rng.normal(0, 0.2, len(rows)))
                logs = np.log(10.0 * mode) + np.hypot(errors, scatter) * self.rng.normal(size=len(rows))
                logs = logs + (added or {}).get((int(p), mode), np.zeros(len(self.pose)))[rows]
                result.append(Series(f"P{p:02d}", mode, 10.0 * mode, "frequency", tuple(rows.tolist()), logs, errors))
        return result
