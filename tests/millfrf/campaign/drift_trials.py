"""Trials of the report of a campaign: false alarms and power of drift, of drifts of a pose's own, of outlying sets.

Series of frequencies with normal scatter are made without files. Drifts are told as multiples of the scatter, end to
end. `benchmarks/campaign_drift.py` runs them; docs/campaigns.md has the tables.
"""

from collections.abc import Callable

import numpy as np
from simulated_series import Simulated

from millfrf.campaign.results.drift import Drifts, find_drifts
from millfrf.campaign.results.outliers import drifts_and_outliers

SCATTER = float(np.hypot(1e-3, 5e-4))
BOTH = ("session", "temperature_c")

Trial = Callable[[int], bool]


def named(drifts: Drifts) -> bool:
    """Whether any drift is named."""
    return bool(drifts.drifts or drifts.pooled)


def quiet(seed: int) -> bool:
    """Equal scatter, six poses, four sessions of two sets."""
    made = Simulated(seed)
    return named(find_drifts(made.series(), made.labels(*BOTH)))


def uneven(seed: int) -> bool:
    """Scatter that differs between poses and modes by a factor of 1.6, four sessions of one set."""
    made = Simulated(seed, repeats=1)
    added = {
        (p, m): 1e-3 * np.exp(made.rng.normal(0, 0.5)) * made.rng.normal(size=len(made.pose))
        for p in range(6)
        for m in (1, 2)
    }
    return named(find_drifts(made.series(added, scatter=1e-5), made.labels(*BOTH)))


def quiet_in_two(seed: int) -> bool:
    """Two sessions of one set, twelve poses."""
    made = Simulated(seed, sessions=2, repeats=1, poses=12, modes=3)
    return named(find_drifts(made.series(), made.labels("session")))


def no_outlier(seed: int) -> bool:
    """No set stands off."""
    made = Simulated(seed)
    return bool(drifts_and_outliers(made.series(), made.labels("session"))[1].deviations)


def alike(poses: int, spread: float) -> Trial:
    """All poses drift, with slopes that scatter; is one called its own?"""

    def run(seed: int) -> bool:
        made = Simulated(seed, poses=poses)
        slopes = -3e-3 * (1 + spread * made.rng.normal(size=(poses, 2)))
        added = {(p, m): slopes[p, m - 1] * made.session for p in range(poses) for m in (1, 2)}
        return any(each.own for each in find_drifts(made.series(added), made.labels("session")).drifts)

    return run


def own(poses: int) -> Trial:
    """All poses drift by three times the scatter, and one by nine times more."""

    def run(seed: int) -> bool:
        made = Simulated(seed, poses=poses)
        slopes = np.full((poses, 2), -SCATTER)
        slopes[3, 1] -= 3 * SCATTER
        added = {(p, m): slopes[p, m - 1] * made.session for p in range(poses) for m in (1, 2)}
        result = find_drifts(made.series(added), made.labels("session")).drifts
        return any((each.trend.series.pose, each.trend.series.mode) == ("P03", 2) and each.own for each in result)

    return run


def one_drift(times: float, sessions: int, repeats: int, poses: int = 6) -> Trial:
    """One mode of one pose drifts by so many times the scatter from the first session to the last."""

    def run(seed: int) -> bool:
        made = Simulated(seed, sessions=sessions, repeats=repeats, poses=poses)
        line = {(3, 2): -times * SCATTER / (sessions - 1) * made.session}
        result = find_drifts(made.series(line), made.labels("session")).drifts
        return ("P03", 2) in [(each.trend.series.pose, each.trend.series.mode) for each in result]

    return run


TRIALS: dict[str, Trial] = {
    "false alarm: six poses, 4 x 2 sets": quiet,
    "false alarm: scatter differs by 1.6, 4 x 1 sets": uneven,
    "false alarm: twelve poses, 2 x 1 sets": quiet_in_two,
    "false alarm: a set stands off": no_outlier,
    "called its own: six poses drift alike": alike(6, 0.0),
    "called its own: six poses, slopes differ by half": alike(6, 0.5),
    "called its own: twelve poses, slopes differ by half": alike(12, 0.5),
    "power: its own, six poses": own(6),
    "power: its own, twelve poses": own(12),
    "power: 4.5 x scatter, 4 x 2 sets": one_drift(4.5, 4, 2),
    "power: 6 x scatter, 4 x 2 sets": one_drift(6.0, 4, 2),
    "power: 3 x scatter, 4 x 4 sets": one_drift(3.0, 4, 4, 4),
    "power: 3 x scatter, 4 x 6 sets": one_drift(3.0, 4, 6, 4),
    "power: 10 x scatter, 4 x 1 sets": one_drift(10.0, 4, 1),
    "power: 18 x scatter, 2 x 1 sets, twelve poses": one_drift(18.0, 2, 1, 12),
}


def main(campaigns: int = 300, first: int = 50_000) -> None:
    """Print the share of each trial with its 95 % interval (Wilson)."""
    for name, trial in TRIALS.items():
        count = sum(trial(first + k) for k in range(campaigns))
        p, z = count / campaigns, 1.96
        middle = (p + z**2 / (2 * campaigns)) / (1 + z**2 / campaigns)
        half = z / (1 + z**2 / campaigns) * np.sqrt(p * (1 - p) / campaigns + z**2 / (4 * campaigns**2))
        ends = f"{100 * max(middle - half, 0):.1f} to {100 * (middle + half):.1f} %"
        print(f"{name:52} {count:4d} of {campaigns}: {100 * p:5.1f} %   ({ends})", flush=True)
