"""`fit_subspace`: modal model from recordings without intermediate spectra, from stacked tests."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from estimation import BandRecording, family_of
from millfrf.core import SI_UNITS, InputError, MillfrfError, Result, Summary

from .maximum_likelihood.likelihood_fit import best_fit, modal_model_from
from .maximum_likelihood.whole_records import NoiseLevels, record_spectra
from .models.modal_model import ModalModel
from .models.synthesis import fit_summary
from .stabilisation import OrderPoles, PoleGroup, StabilisationChart, choose_poles, stabilisation_chart

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_CHUNK = 4096


@dataclass(frozen=True)
class CorrelationBlocks:
    """Sum of ``z z^T`` over tests and samples; z = (future force, past force, past response, future response).

    Parameters
    ----------
    matrix : (n, n) with n = 2 block_rows (n_excitations + n_responses)
        The sum, for channels scaled to unit root mean square.
    block_rows
        Number of samples in the past and in the future.
    n_excitations, n_responses
        Numbers of channels on either side.
    response_scale : (n_responses,)
        Root mean square of each response over all tests.
    sample_rate : Hz
        Samples a second.
    n_samples
        Number of columns z that were summed.
    """

    matrix: NDArray[np.float64]
    block_rows: int
    n_excitations: int
    n_responses: int
    response_scale: NDArray[np.float64]
    sample_rate: float
    n_samples: int


def correlation_blocks(recordings: Sequence[BandRecording], block_rows: int) -> CorrelationBlocks:
    """Sum the correlation blocks of all tests; no test's samples meet another's.

    Raises
    ------
    InputError
        No recording, recordings of different rates or channels, or too few samples for ``block_rows``.
    """
    if not recordings:
        raise InputError("no recording to fit; give at least one recording")
    first = recordings[0]
    for number, recording in enumerate(recordings[1:], start=2):
        if recording.rate != first.rate:
            raise InputError(
                f"test {number} has {recording.rate:g} Hz after decimation, test 1 has {first.rate:g} Hz; "
                "stack tests of one sample rate"
            )
        if (recording.excitations, recording.responses) != (first.excitations, first.responses):
            raise InputError(f"test {number} has other channels than test 1; stack tests of one set-up only")
    excitation_scale = _root_mean_square([r.force for r in recordings])
    response_scale = _root_mean_square([r.response for r in recordings])
    n_in, n_out = len(excitation_scale), len(response_scale)
    size = 2 * block_rows * (n_in + n_out)
    matrix = np.zeros((size, size))
    n_samples = 0
    for recording in recordings:
        force = (recording.force - recording.force.mean(axis=0)) / excitation_scale
        motion = (recording.response - recording.response.mean(axis=0)) / response_scale
        count = len(force) - 2 * block_rows + 1
        for start in range(0, max(count, 0), _CHUNK):
            stop = min(start + _CHUNK, count)
            rows = _stacked(force, motion, block_rows, start, stop)
            matrix += rows.T @ rows
            n_samples += stop - start
    if n_samples < 2 * size:
        raise InputError(
            f"{n_samples} samples after decimation are too few for {size} correlation rows; "
            "record longer or use fewer block rows"
        )
    return CorrelationBlocks(matrix, block_rows, n_in, n_out, response_scale, first.rate, n_samples)


def _root_mean_square(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    power = sum(np.sum((part - part.mean(axis=0)) ** 2, axis=0) for part in parts) / sum(len(part) for part in parts)
    return np.asarray(np.sqrt(np.where(power > 0, power, 1.0)))


def _stacked(
    force: NDArray[np.float64], motion: NDArray[np.float64], block_rows: int, start: int, stop: int
) -> NDArray[np.float64]:
    """Rows (future force, past force, past response, future response) for samples start..stop-1."""
    shifts = range(block_rows)
    pieces = []
    for samples, offset in ((force, block_rows), (force, 0), (motion, 0), (motion, block_rows)):
        pieces += [samples[start + offset + k : stop + offset + k] for k in shifts]
    return np.hstack(pieces)


_BLOCK_ROWS = 25
_SPARE_ROWS = 1.5  # observability matrix has so many times more rows than the highest order has states
_SMOOTH = 2  # terms of the polynomial that stands for transients from outside the band


@dataclass(frozen=True, eq=False, repr=False)
class SubspaceFit(Result):
    """A modal model from recordings, with the evidence for it.

    Parameters
    ----------
    model
        Receptance model with residuals and covariance.
    chart
        Stabilisation chart: poles over order.
    dropped
        Groups of poles not taken for modes, each with its reason.
    band : Hz
        Lowest and highest frequency of the fit.
    reduced_chi_square
        Misfit over the noise found; noise is estimated from the misfit itself, so 1 only says that the error
        is spread over channels and lines as noise on forces and responses would be.
    noise
        Noise variances found on responses and forces, per test.
    warnings
        Doubts about the fit, one sentence each.
    """

    model: ModalModel
    chart: StabilisationChart
    dropped: tuple[PoleGroup, ...]
    band: tuple[float, float]
    reduced_chi_square: float
    noise: NoiseLevels
    warnings: tuple[str, ...]

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw the FRF that the model gives and return the axes; see `draw_model` for the choices."""
        return self.model.plot(axes, **choices)

    def _summary(self) -> Summary:
        chi_square = "not known" if np.isnan(self.reduced_chi_square) else f"{self.reduced_chi_square:.3g}"
        note = f"fit of {self.band[0]:.4g} to {self.band[1]:.4g} Hz, reduced chi-square {chi_square}"
        return fit_summary("SubspaceFit", self.model, (note,), self.warnings)


def fit_subspace(
    recordings: Sequence[BandRecording],
    band: tuple[float, float],
    *,
    max_order: int = 30,
    block_rows: int | None = None,
    n_modes: int | None = None,
) -> SubspaceFit:
    """Fit a modal model to stacked tests with measured forces.

    Input-output subspace identification (past outputs and inputs as instruments; Van Overschee & De Moor, Subspace
    Identification for Linear Systems, 1996, chapter 4; Verhaegen 1994) on correlation blocks summed over the tests
    gives poles over model order; the chosen ones start a maximum-likelihood fit of the whole-recording spectra in the
    band, with left and right vectors, out-of-band terms, transients, and noise on forces as well as responses.

    Parameters
    ----------
    recordings
        One a test, from :func:`estimation.band_recording`; all of one sample rate and channel layout.
    band
        Hz; the modes to be found lie inside.
    max_order
        Highest order of the state-space model (two states a mode).
    block_rows
        Samples of past and future in the correlations; None: 25, and more where few responses are to carry the highest
        order.
    n_modes
        Keep the ``n_modes`` groups found in most orders; None: as many as there are.

    Raises
    ------
    InputError
        Records that cannot be stacked, too short ones, or a band outside what they hold.
    MillfrfError
        No pole is stable over the orders, or the refinement does not converge.
    """
    spectra = record_spectra(recordings, band)
    block_rows = _enough_rows(max_order, len(recordings[0].responses)) if block_rows is None else block_rows
    blocks = correlation_blocks(recordings, block_rows)
    if not 2 <= max_order < block_rows * blocks.n_responses:
        raise InputError(
            f"highest order {max_order} does not fit {block_rows} block rows of {blocks.n_responses} responses; "
            f"stay between 2 and {block_rows * blocks.n_responses - 1}"
        )
    chart = stabilisation_chart(list(subspace_poles(blocks, band, max_order)), band)
    kept, dropped = choose_poles(chart)
    if n_modes is not None:
        kept = tuple(sorted(kept, key=_minus_orders)[:n_modes])
    if not kept:
        raise MillfrfError(
            f"no pole is stable over orders 2 to {max_order} between {band[0]:g} and {band[1]:g} Hz; "
            "widen the band or record longer"
        )
    fit = best_fit(np.array([group.pole for group in kept]), spectra, band, n_smooth=_SMOOTH)
    responses = [channel.degree_of_freedom for channel in recordings[0].responses]
    excitations = [channel.degree_of_freedom for channel in recordings[0].excitations]
    unit = _unit(recordings[0])
    model = modal_model_from(fit, band, responses, excitations, unit)
    warnings = (
        () if fit.converged else ("the refinement stopped before it converged; treat the error bars as lower bounds",)
    )
    return SubspaceFit(model, chart, dropped, band, fit.reduced_chi_square, fit.noise, warnings)


def _unit(recording: BandRecording) -> str:
    """Unit of the model: deflections, whatever derivative was measured, over what excites.

    Raises
    ------
    InputError
        Responses, or excitations, of different kinds: a model has one unit.
    """
    moving = {family_of(channel.quantity)[0] for channel in recording.responses}
    driving = {channel.quantity for channel in recording.excitations}
    for role, kinds in (("responses", moving), ("excitations", driving)):
        if len(kinds) > 1:
            raise InputError(f"{role} of different kinds ({', '.join(sorted(kinds))}); choose channels of one kind")
    return f"{SI_UNITS[moving.pop()]}/{SI_UNITS[driving.pop()]}"


def _enough_rows(max_order: int, n_responses: int) -> int:
    """Block rows whose observability matrix holds the highest order; a single sensor needs more than three do.

    Examples
    --------
    >>> _enough_rows(30, 3), _enough_rows(30, 1)
    (25, 45)
    """
    return max(_BLOCK_ROWS, math.ceil(_SPARE_ROWS * max_order / n_responses))


def _minus_orders(group: PoleGroup) -> int:
    return -group.n_orders


def subspace_poles(blocks: CorrelationBlocks, band: tuple[float, float], max_order: int) -> Iterator[OrderPoles]:
    """Poles and shapes of even orders 2 ... ``max_order`` from one factorisation of the correlation blocks.

    The Cholesky factor of the correlations is the transposed triangular factor of the data; its block of future
    responses on past forces and responses spans the observability matrix, of which each order takes the leading
    singular vectors.
    """
    n_in, n_out, rows = blocks.n_excitations, blocks.n_responses, blocks.block_rows
    scale = np.sqrt(np.diag(blocks.matrix))
    normal = blocks.matrix / np.outer(scale, scale)
    factor = np.linalg.cholesky(normal + 1e-12 * np.eye(len(normal)))
    past, future = n_in * rows, (2 * n_in + n_out) * rows
    projected = factor[future:, past:future] * scale[future:, None]
    vectors, _, _ = np.linalg.svd(projected, full_matrices=False)
    low, high = 2 * np.pi * band[0], 2 * np.pi * band[1]
    for order in range(2, max_order + 1, 2):
        observability = vectors[:, :order]
        transition = np.linalg.lstsq(observability[:-n_out], observability[n_out:], rcond=None)[0]
        eigenvalues, modes = np.linalg.eig(transition)
        usable = np.abs(eigenvalues) > 1e-9
        poles = np.log(eigenvalues[usable].astype(complex)) * blocks.sample_rate
        shapes = (observability[:n_out] @ modes[:, usable]).T * blocks.response_scale
        magnitude = np.abs(poles)
        kept = (poles.imag > 0) & (poles.real < 0) & (magnitude > low) & (magnitude < high)
        length = np.linalg.norm(shapes[kept], axis=1, keepdims=True)
        yield OrderPoles(order, poles[kept], np.asarray(shapes[kept] / length, dtype=complex))
