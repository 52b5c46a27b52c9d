"""Delays between forces and responses: the earliest force that a response depends on, block by block."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Index, Real

from .record_blocks import RecordBlocks
from .settings import GATE


@dataclass(frozen=True)
class Onsets:
    """Delays of the responses of one recording behind its forces.

    Parameters
    ----------
    name
        Name of the recording.
    times : (n_blocks,), s
        Middle of each block.
    joint : (n_blocks,), s
        Delay of all responses together in each block.
    delays : (n_blocks, n_responses), s
        Delay of each response in each block.
    p_values : (n_blocks,)
        Probability that the best of all responses follows the forces as well as it does by chance.
    resolution : s
        Standard error of a delay within its block: rounding to samples, and rises at other lags than the largest.
    resolutions : (n_responses,), s
        The same of each response.
    channels
        Names of the responses.
    known : (n_responses,), s
        Delay of each response that its channel states.
    """

    name: str
    times: Real
    joint: Real
    delays: Real
    p_values: Real
    resolution: float
    resolutions: Real
    channels: tuple[str, ...]
    known: Real


def onsets_of(blocks: RecordBlocks) -> Onsets:
    """Find the delays of the responses of one recording.

    Each response x is regressed on its own past and on the forces at the lags d, d + 1, ...:
    ``x(t) = sum_k a_k x(t - k) + sum_{k >= d} b_k f(t - k) + e(t)``. The models are nested, so that one QR
    factorisation gives the residual of each first lag d. A structure responds at once: up to the true delay the
    residual does not depend on d, and beyond it the residual rises, most where the first force that matters is left
    out. A first search, with the main direction of the forces at a lower rate, covers ``GATE.longest_delay``.
    """
    excitation_delay = _known(blocks.excitations).mean()
    joint, delays, p_values, widths = [], [], [], []
    for force, response in zip(blocks.force, blocks.response, strict=True):
        # forces that repeat with each tooth follow themselves a few teeth later, too, most of all along one direction
        middles = {_coarse(force, response, blocks.rate), 0}
        searches = [_fine(force, response, middle) for middle in sorted(middles, key=abs)]
        lags, rises, p_value = max(searches, key=lambda search: search[1][-1].max())
        first = lags[rises.argmax(axis=1)]
        joint.append(first[-1])
        delays.append(first[:-1])
        p_values.append(p_value)
        squares = (lags - first[:, None]) ** 2
        widths.append(np.sum(rises**2 * squares, axis=1) / np.maximum(np.sum(rises**2, axis=1), 1e-300))
    resolutions = np.sqrt(1 / 12 + np.mean(widths, axis=0)) / blocks.rate
    return Onsets(
        blocks.name,
        blocks.times,
        np.array(joint) / blocks.rate,
        np.array(delays) / blocks.rate,
        np.array(p_values),
        float(resolutions[-1]),
        resolutions[:-1],
        tuple(channel.name for channel in blocks.responses),
        _known(blocks.responses) - excitation_delay,
    )


def _known(channels: Sequence[object]) -> Real:
    return np.array([getattr(channel, "input_delay_s", None) or 0.0 for channel in channels])


def _fine(force: Real, response: Real, middle: int) -> tuple[Index, Real, float]:
    """Search around a delay, in samples: lags, rises of each response and of all, and the least p-value."""
    span = 5 * GATE.coarse_step
    lags = middle - 2 * GATE.coarse_step + np.arange(span + GATE.onset_lags)
    steps, p = zip(*_steps(force, response, lags), strict=True)
    rises = np.array(steps)[:, :span]
    return lags[:span], np.vstack([rises, rises.sum(axis=0)]), min(p)


def _coarse(force: Real, response: Real, rate: float) -> int:
    """Return the delay in samples, from every fourth sample and the main direction of the forces."""
    step = GATE.coarse_step
    main = force @ np.linalg.svd(force, full_matrices=False)[2][:1].T
    slow = [scipy.signal.decimate(signal, step, ftype="fir", axis=0) for signal in (main, response)]
    # lags -d to d leave n - p - d rows for 2 d + 1 + p unknowns (p past samples); at least two rows for each unknown
    most = (len(slow[0]) - 3 * GATE.onset_past - 2) // 5
    longest = min(int(GATE.longest_delay * rate / step), most)
    if longest < 1:
        return 0
    lags = np.arange(-longest, longest + 1)
    rises = sum(rise for rise, _ in _steps(slow[0], slow[1], lags))
    return int(lags[int(np.argmax(rises))]) * step


def _steps(force: Real, responses: Real, lags: Index) -> Iterator[tuple[Real, float]]:
    """Yield for each response the rise of its logarithmic residual where each lag is left out, and a p-value.

    Rises have shape (n_lags - 1,). The p-value is that of the F-test of all forces: whether the response depends on
    them at any lag. The products of the forces are the same for all responses.
    """
    n, past = len(force), GATE.onset_past
    first, last = max(past, int(lags[-1])), n + min(0, int(lags[0]))
    forces = np.hstack([force[first - k : last - k] for k in lags[::-1]])
    forces = forces - forces.mean(axis=0)
    of_forces = forces.T @ forces
    for x in responses.T:
        own = np.column_stack([*(x[first - k : last - k] for k in range(1, past + 1)), x[first:last]])
        own -= own.mean(axis=0)
        square, cross = own.T @ own, own.T @ forces
        products = np.block(
            [
                [square[:past, :past], cross[:past], square[:past, past:]],
                [cross[:past].T, of_forces, cross[past:].T],
                [square[past:, :past], cross[past:], square[past:, past:]],
            ]
        )
        column = _last_column(products)
        if column is None:
            table = np.hstack([own[:, :past], forces, own[:, past:]])
            column = np.asarray(np.linalg.qr(table, mode="r"))[: table.shape[1], -1]
        by_lag = (column[past:-1] ** 2).reshape(len(lags), -1).sum(axis=1)[::-1]
        rest, freedom = float(column[-1] ** 2), last - first - len(column)
        left = rest + np.concatenate([[0.0], np.cumsum(by_lag)[:-1]])
        count = len(column) - 1 - past
        ratio = by_lag.sum() / count / (rest / freedom) if rest > 0 else np.inf
        yield np.diff(np.log(np.maximum(left, 1e-300))), float(scipy.stats.f.sf(ratio, count, freedom))


def _last_column(products: Real) -> Real | None:
    """Return the last column of the Cholesky factor of products of columns; None if rounding would reach the residual.

    It is the last column of the triangle of their QR factorisation, up to signs, at a sixth of its cost.
    """
    scale = np.sqrt(np.maximum(np.diag(products), 1e-300))
    try:
        factor = np.linalg.cholesky(products / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return None
    coefficients = scipy.linalg.solve_triangular(factor[:-1, :-1], factor[-1, :-1], lower=True, trans=1)
    rounding = np.finfo(float).eps * (1 + np.abs(coefficients).sum()) ** 2
    return None if factor[-1, -1] ** 2 < GATE.over_rounding * rounding else np.asarray(factor[-1] * scale[-1])


def check_onsets(onsets: Sequence[Onsets]) -> list[str]:
    """Compare the delays of blocks, recordings and channels with zero and with each other, and return warnings.

    All comparisons are t-tests on the scatter between blocks, with the rounding of the delays to whole samples in the
    error bar.
    """
    warnings, following = [], []
    for test in onsets:
        p_value, middle = _combined(test.p_values), float(np.median(test.joint))
        far = np.abs(test.joint - middle) > scipy.stats.norm.isf(GATE.p_value / 2) * test.resolution
        if p_value > GATE.p_value:
            warnings.append(
                f"{test.name}: the responses do not follow the forces (p = {p_value:.2g}): was it a cut, and is the "
                "force that of this test? Leave the recording out, or record again"
            )
        elif far.mean() > 0.5:
            warnings.append(
                f"{test.name}: the responses follow the forces at no common delay ({1e3 * test.joint.min():.0f} to "
                f"{1e3 * test.joint.max():.0f} ms in {len(far)} blocks): forces and responses run on two clocks, or "
                "are mostly noise; record both on one clock"
            )
        else:
            following.append(test)
    drifts = {test.name: _drift([test]) for test in following}
    warnings += [text for text in drifts.values() if text]
    steady = [test for test in following if not drifts[test.name]]
    if len(steady) == len(following) > 1 and (text := _drift(steady)):
        return [*warnings, text]
    if steady:
        warnings += _levels(steady) or _between_channels(steady)
    return warnings


def _combined(p_values: Real) -> float:
    """Combine the p-values of the blocks by Fisher's method."""
    statistic = -2 * np.sum(np.log(np.maximum(p_values, 1e-300)))
    return float(scipy.stats.chi2.sf(statistic, 2 * len(p_values)))


@dataclass(frozen=True)
class Estimate:
    """A delay or drift with the variance of its scatter, the freedom of this variance, and that of its resolution."""

    value: float
    scatter: float
    freedom: int
    resolution: float

    @property
    def error(self) -> float:
        """Standard error."""
        return float(np.sqrt(self.scatter + self.resolution))

    @property
    def significant(self) -> bool:
        """Whether the value is not zero, by a t-test with the effective freedom of Welch and Satterthwaite."""
        total = self.scatter + self.resolution
        if total <= 0 or self.freedom < 1:
            return False
        freedom = self.freedom * (total / self.scatter) ** 2 if self.scatter > 0 else np.inf
        return bool(2 * scipy.stats.t.sf(abs(self.value) / self.error, min(freedom, 1e9)) < GATE.p_value)


def _level(values: Real, resolution: float) -> Estimate:
    n = len(values)
    return Estimate(float(np.median(values)), float(values.var(ddof=1)) / n if n > 1 else 0.0, n - 1, resolution**2)


def _drift(tests: Sequence[Onsets]) -> str | None:
    """Return a warning if the delay grows alike along all recordings: two clocks of different rate."""
    tests = [test for test in tests if len(test.times) >= 4]
    if not tests:
        return None
    parts = [_growth(test) for test in tests]
    drift = Estimate(
        float(np.mean([part.value for part in parts])),
        sum(part.scatter for part in parts) / len(parts) ** 2,
        sum(part.freedom for part in parts),
        sum(part.resolution for part in parts) / len(parts) ** 2,
    )
    apart = sum(((part.value - drift.value) / part.error) ** 2 for part in parts if part.error > 0)
    alike = len(parts) == 1 or scipy.stats.chi2.sf(apart, len(parts) - 1) > GATE.p_value
    if not drift.significant or not alike:
        return None
    name, slope = tests[0].name if len(tests) == 1 else "all recordings", drift.value
    return (
        f"{name}: the responses come later and later behind the forces, by {1e3 * slope:.2g} ms each second: two "
        f"clocks differ by {100 * slope:.2g} %; record forces and responses on one clock"
        if slope > 0
        else f"{name}: the responses gain {-1e3 * slope:.2g} ms on the forces each second: two clocks differ by "
        f"{-100 * slope:.2g} %; record forces and responses on one clock"
    )


def _growth(test: Onsets) -> Estimate:
    """Return the growth of the delay of all responses of a recording in its time, s/s."""
    time, n = test.times - test.times.mean(), len(test.times)
    slope = float(time @ test.joint / (time @ time))
    rest = test.joint - test.joint.mean() - slope * time
    scatter = float(rest @ rest) / (n - 2) / (time @ time)
    return Estimate(slope, scatter, n - 2, test.resolution**2 / (time @ time))


def _levels(onsets: Sequence[Onsets]) -> list[str]:
    """Return warnings about recordings whose responses come late or early, all by the same time or some alone."""
    levels = {test.name: _level(test.joint - float(np.median(test.known)), test.resolution) for test in onsets}
    wrong = {name: level for name, level in levels.items() if level.significant}
    if len(wrong) == len(onsets) > 1:
        middle = sorted(wrong.values(), key=lambda level: level.value)[len(wrong) // 2]
        if all(abs(level.value - middle.value) <= 2 * (level.error + middle.error) for level in wrong.values()):
            return [_late("all recordings", middle)]
    return [_late(name, level) for name, level in wrong.items()]


def _late(name: str, delay: Estimate) -> str:
    return (
        f"{name}: the responses are {1e3 * abs(delay.value):.3g} +- {1e3 * delay.error:.2g} ms "
        f"{'behind' if delay.value > 0 else 'ahead of'} the forces: a filter, another device or a shifted file delays "
        "one of them; state input_delay_s of its channels, or record again"
    )


def _between_channels(onsets: Sequence[Onsets]) -> list[str]:
    """Return warnings about single responses that are late or early compared with the others, in all recordings."""
    delays = np.concatenate([test.delays - test.joint[:, None] for test in onsets])
    known = onsets[0].known - float(np.median(onsets[0].known))
    texts = []
    resolutions = np.mean([test.resolutions for test in onsets], axis=0)
    for name, column, stated, resolution in zip(onsets[0].channels, delays.T, known, resolutions, strict=True):
        level = _level(column - stated, float(resolution))
        if level.significant:
            texts.append(
                f"{name} is {1e3 * abs(level.value):.3g} +- {1e3 * level.error:.2g} ms "
                f"{'late' if level.value > 0 else 'early'} compared with the other responses: state input_delay_s of "
                "the channel, or use the same filter for all"
            )
    return texts
