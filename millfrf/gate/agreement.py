"""Whether recordings of one set-up belong to one linear structure, and which channel of which recording does not."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import scipy

from acquisition import Recording
from estimation import BandRecording
from millfrf.core import Band, Index, InputError, Real
from modal_fit import moving_modes

from .onsets import check_onsets, onsets_of
from .record_blocks import RecordBlocks, blocks_of_recordings
from .settings import GATE
from .signal_faults import has_coarse_channel
from .stated_cuts import check_cuts


def check_consistency(
    recordings: Sequence[Recording],
    stream: str | None = None,
    excitations: Sequence[str] = (),
    responses: Sequence[str] = (),
) -> list[str]:
    """Compare forces and responses of recordings within each recording and between them, and return warnings.

    Parameters
    ----------
    recordings
        Open recordings of one set-up.
    stream
        Sample clock; None: the only one.
    excitations, responses
        Channel names; empty: chosen by quantity.
    """
    tests = blocks_of_recordings(recordings, stream, excitations, responses)
    late = check_onsets([onsets_of(test) for test in tests])
    # a delay or the noise of rounding makes signs and sizes disagree, too
    names = [channel.name for channel in (*tests[0].excitations, *tests[0].responses)] if tests else []
    coarse = any(has_coarse_channel(recording.stream(stream), names) for recording in recordings)
    return [*(late or ([] if coarse else check_agreement(tests))), *check_cuts(tests)]


def check_constant_modes(recordings: Sequence[BandRecording], band: Band) -> list[str]:
    """Return a warning if natural frequencies move between recordings or within one.

    Parameters
    ----------
    recordings
        Records of one set-up and rate. Of records that are too short for the test nothing is said.
    band : Hz
        Lowest and highest frequency.
    """
    try:
        motion = moving_modes(recordings, band)
    except InputError:
        return []
    text = motion.warning([recording.name for recording in recordings]) if motion is not None else ""
    return [text] if text else []


# measured over true, and what most likely causes it
WRONG_UNITS = (
    (1 / 9.80665, "g called m/s^2?"),
    (9.80665, "multiplied by 9.80665 twice?"),
    (1e-3, "kN called N, or mm called m?"),
    (1e3, "mN called N, or km called m?"),
)


@dataclass(frozen=True)
class Change:
    """A correction of one recording: its forces times ``forces``, and its responses in another order and scale."""

    test: int
    text: str
    forces: Real  # (n_excitations, n_excitations)
    order: Index  # (n_responses,): which recorded response is response p
    gains: Real  # (n_responses,)


@dataclass(frozen=True)
class Regressions:
    """Products of the regressions of all responses of one recording.

    Parameters
    ----------
    products : (n_responses, n_columns + 1, n_columns + 1)
        Products of the columns: the response's own past, the forces lag by lag, a constant; last the response.
    own : (n_responses,)
        Residual sum of squares of the recording's own regression.
    rows
        Number of rows.
    """

    products: Real
    own: Real
    rows: int


def regressions_of(blocks: RecordBlocks) -> Regressions:
    """Sum the products of ``x(t) = sum_k a_k x(t - k) + sum_k b_k f(t - k) + c`` over all blocks, by response."""
    past, lags, n_responses = GATE.onset_past, GATE.agreement_lags, len(blocks.responses)
    first = max(past, lags)
    parts, rows = [], 0
    for force, response in zip(blocks.force, blocks.response, strict=True):
        n = len(force)
        forces = np.hstack([force[first - k : n - k] for k in range(lags)] + [np.ones((n - first, 1))])
        tables = [
            np.hstack([*(x[first - k : n - k, None] for k in range(1, past + 1)), forces, x[first:, None]])
            for x in response.T
        ]
        parts.append([table.T @ table for table in tables])
        rows += n - first
    products = np.sum(parts, axis=0)
    own = np.array([_residual(products[p], _solved(products[p])) for p in range(n_responses)])
    return Regressions(products, own, rows)


def _solved(product: Real) -> Real:
    scale = np.sqrt(np.maximum(np.diag(product)[:-1], 1e-300))
    matrix = product[:-1, :-1] / np.outer(scale, scale) + 1e-12 * np.eye(len(scale))
    return np.asarray(np.linalg.solve(matrix, product[:-1, -1] / scale) / scale)


def _residual(product: Real, coefficients: Real) -> float:
    vector = np.append(-coefficients, 1.0)
    return float(max(vector @ product @ vector, 1e-12 * product[-1, -1]))


class Agreement:
    """The common regression of all recordings, with corrections of some of them."""

    def __init__(self, tests: Sequence[RecordBlocks]) -> None:
        self.tests = tests
        self._regressions = [regressions_of(test) for test in tests]
        self.n_forces, self.n_responses = len(tests[0].excitations), len(tests[0].responses)
        self.n_columns = self._regressions[0].products.shape[1] - 1

    @property
    def freedom(self) -> int:
        """Number of coefficients that the recordings' own regressions have more than the common one."""
        return int((len(self.tests) - 1) * self.n_columns * self.n_responses)

    def misfit(self, changes: Sequence[Change] = ()) -> float:
        """Return the sum over recordings and responses of ``rows log(common residual / own residual)``."""
        total = 0.0
        for p in range(self.n_responses):
            corrected = [self._corrected(t, p, changes) for t in range(len(self.tests))]
            joint = sum(product / own for product, own in corrected)
            coefficients = _solved(np.asarray(joint))
            for (product, own), regression in zip(corrected, self._regressions, strict=True):
                total += regression.rows * float(np.log(_residual(product, coefficients) / own))
        return total

    def _corrected(self, test: int, response: int, changes: Sequence[Change]) -> tuple[Real, float]:
        """Return products and own residual of a response of a recording after the corrections."""
        regression, past = self._regressions[test], GATE.onset_past
        factor, source, gain = np.eye(self.n_columns + 1), response, 1.0
        for change in changes:
            if change.test == test:
                gain *= change.gains[response]
                source = int(change.order[source])
                for k in range(GATE.agreement_lags):
                    at = slice(past + k * self.n_forces, past + (k + 1) * self.n_forces)
                    factor[at, at] = change.forces @ factor[at, at]
        own = [*range(past), self.n_columns]
        factor[own, own] = gain
        return factor @ regression.products[source] @ factor.T, gain**2 * float(regression.own[source])


class DrivenLines:
    """Spectra of the blocks of all recordings, at the lines that hold nearly all of the forces."""

    def __init__(self, tests: Sequence[RecordBlocks]) -> None:
        length = min(len(block) for test in tests for block in test.force)
        window = np.hanning(length)[:, None]
        spectra = [
            [np.fft.rfft([block[:length] * window for block in side], axis=1) for side in (test.force, test.response)]
            for test in tests
        ]
        power = np.sum([np.sum(np.abs(force) ** 2, axis=(0, 2)) for force, _ in spectra], axis=0)
        power[0] = 0.0  # the means are not compared
        order = np.argsort(-power)
        count = int(np.searchsorted(np.cumsum(power[order]), GATE.driven_share * power.sum())) + 1
        self._spectra = [(force[:, order[:count]], response[:, order[:count]]) for force, response in spectra]

    def incoherence(self, changes: Sequence[Change]) -> float:
        """Return the mean of ``ln(1 - gamma^2)`` over lines and responses, with the multiple coherence gamma^2."""
        corrected = []
        for test, (force, response) in enumerate(self._spectra):
            for change in changes:
                if change.test == test:
                    force, response = force @ change.forces.T, response[:, :, change.order] * change.gains
            corrected.append((force, response))
        force, response = (np.concatenate(side).transpose(1, 0, 2) for side in zip(*corrected, strict=True))
        scale = np.linalg.norm(force, axis=1, keepdims=True)
        basis = np.linalg.qr(force / np.where(scale > 0, scale, 1.0))[0]
        left = response - basis @ (basis.conj().swapaxes(1, 2) @ response)
        powers = [np.sum(np.abs(part) ** 2, axis=1) for part in (left, response)]
        return float(np.mean(np.log(np.maximum(powers[0], 1e-12 * powers[1]) / np.maximum(powers[1], 1e-300))))


def check_agreement(tests: Sequence[RecordBlocks]) -> list[str]:
    """Look for channels whose sign, size or place differs between recordings of one set-up, and return warnings.

    One linear structure gives one regression for all recordings (Chow 1960). If a correction of one recording lowers
    the misfit of the common regression, an F-test compares this gain with the misfit that remains, so that nonlinear
    structures, which no correction makes equal, give no warning. Noise of the samples biases the regression of each
    recording by another amount, and corrections may only move this bias: the FRF of all recordings together, which has
    no such bias, must become more coherent, too. Corrections are tested again after the first.

    Parameters
    ----------
    tests
        Blocks of recordings with equal channels and rates; one recording gives no warning.
    """
    if len(tests) < 2 or not tests[0].responses or not tests[0].excitations:
        return []
    agreement = Agreement([_strongest(test, tests[0]) for test in tests])
    candidates = [change for t in range(len(tests)) for change in _changes(agreement, t)]
    chosen: list[Change] = []
    misfit, lines = agreement.misfit(), DrivenLines(agreement.tests)
    for _ in range(GATE.corrections):
        results = [(agreement.misfit([*chosen, change]), change) for change in candidates]
        best, change = min(results, key=lambda result: result[0])
        remaining = max(best, float(agreement.freedom)) / agreement.freedom
        p_value = float(scipy.stats.f.sf((misfit - best) / remaining, 1, agreement.freedom))
        fall = lines.incoherence(chosen) - lines.incoherence([*chosen, change])
        if p_value * len(candidates) > GATE.p_value or fall < -np.log(1 - GATE.incoherence_fall):
            break
        chosen.append(change)
        misfit = best
    return [_text(tests, change) for change in chosen]


def _text(tests: Sequence[RecordBlocks], change: Change) -> str:
    others = ", ".join(test.name for k, test in enumerate(tests) if k != change.test)
    return (
        f"{tests[change.test].name} and {others} belong to one structure only if, in {tests[change.test].name}, "
        f"{change.text}: correct the channel in the recording that is wrong; a single late force looks alike"
    )


def _strongest(test: RecordBlocks, first: RecordBlocks) -> RecordBlocks:
    """Keep the responses with the largest motion of their quantity, at most as many as the comparison takes."""
    if len(first.responses) <= GATE.compared_responses:
        return test
    size = np.sum([block.std(axis=0) for block in first.response], axis=0)
    kept = np.sort(np.argsort(-size)[: GATE.compared_responses])
    return replace(
        test,
        response=tuple(block[:, kept] for block in test.response),
        responses=tuple(test.responses[k] for k in kept),
    )


def _changes(agreement: Agreement, test: int) -> Iterator[Change]:
    """Yield the corrections of one recording that are tested."""
    blocks = agreement.tests[test]
    n, m = agreement.n_forces, agreement.n_responses
    forces, order, gains = np.eye(n), np.arange(m), np.ones(m)
    for q, channel in enumerate(blocks.excitations):
        for factor, meaning in _factors():
            change = forces.copy()
            change[q, q] = 1 / factor
            yield Change(test, f"{channel.name} {meaning}", change, order, gains)
    for p, channel in enumerate(blocks.responses):
        for factor, meaning in _factors():
            sizes = gains.copy()
            sizes[p] = 1 / factor
            yield Change(test, f"{channel.name} {meaning}", forces, order, sizes)
    for factor, meaning in _factors():
        yield Change(test, f"each response {meaning}, or each force the inverse of it", forces, order, gains / factor)
    for a, b in combinations(range(n), 2):
        names = f"{blocks.excitations[a].name} and {blocks.excitations[b].name} are exchanged"
        yield Change(test, names, forces[_exchanged(n, a, b)], order, gains)
    for a, b in combinations(range(m), 2):
        names = f"{blocks.responses[a].name} and {blocks.responses[b].name} are exchanged"
        yield Change(test, names, forces, _exchanged(m, a, b), gains)


def _exchanged(n: int, a: int, b: int) -> Index:
    order = np.arange(n)
    order[[a, b]] = b, a
    return order


def _factors() -> Iterator[tuple[float, str]]:
    yield -1.0, "has the opposite sign"
    for factor, meaning in WRONG_UNITS:
        yield factor, f"is {factor:.4g} times its true size ({meaning})"
    for factor in GATE.gain_steps:
        yield factor, f"is too {'small' if factor < 1 else 'large'} (sensitivity, range or amplifier)"
