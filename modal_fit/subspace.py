"""`fit_subspace`: modal model from the recordings of one or more tests, without estimating FRFs."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimation import BandRecording, family_of
from millfrf.core import SI_UNITS, Band, Complex, InputError, MillfrfError, Real

from .maximum_likelihood.likelihood_fit import best_fit, modal_model_from, weakest_mode
from .maximum_likelihood.whole_records import NoiseLevels, record_spectra
from .models.modal_model import ModalModel
from .models.synthesis import NOT_CONVERGED, FittedModel, fit_note, with_outer_as_residuals
from .settings import SETTINGS
from .stabilisation import OrderPoles, PoleGroup, StabilisationChart, choose_poles, stabilisation_chart

_CHUNK = 4096  # samples whose correlation rows are held in memory at a time


@dataclass(frozen=True)
class CorrelationBlocks:
    """Sum of ``z z^T`` over tests and samples; z = (future force, past force, past response, future response)."""

    matrix: Real  # (n, n) with n = 2 block_rows (n_excitations + n_responses), for channels of unit root mean square
    block_rows: int  # number of samples in the past and in the future
    n_excitations: int
    n_responses: int
    response_scale: Real  # (n_responses,): root mean square of each response over all tests
    sample_rate: float  # Hz


def correlation_blocks(recordings: Sequence[BandRecording], block_rows: int) -> CorrelationBlocks:
    """Sum the correlation blocks of all tests; no product of samples spans two tests.

    Raises
    ------
    InputError
        Recordings of different rates or channels, or too few samples for ``block_rows``.
    """
    first = recordings[0]
    for number, recording in enumerate(recordings[1:], start=2):
        if recording.rate != first.rate:
            raise InputError(
                f"test {number} has {recording.rate:g} Hz after decimation, test 1 has {first.rate:g} Hz; "
                "stack tests of one sample rate"
            )
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
    return CorrelationBlocks(matrix, block_rows, n_in, n_out, response_scale, first.rate)


def _root_mean_square(tests: Sequence[Real]) -> Real:
    power = sum(np.sum((test - test.mean(axis=0)) ** 2, axis=0) for test in tests) / sum(len(test) for test in tests)
    return np.asarray(np.sqrt(np.where(power > 0, power, 1.0)))


def _stacked(force: Real, motion: Real, block_rows: int, start: int, stop: int) -> Real:
    """Return rows (future force, past force, past response, future response) for the samples start ... stop - 1."""
    pieces = []
    for samples, offset in ((force, block_rows), (force, 0), (motion, 0), (motion, block_rows)):
        pieces += [samples[start + offset + k : stop + offset + k] for k in range(block_rows)]
    return np.hstack(pieces)


@dataclass(frozen=True, eq=False, repr=False)
class SubspaceFit(FittedModel):
    """A modal model from recordings, with its poles over order, its misfit and its noise.

    Parameters
    ----------
    model
        Receptance model with residuals and covariance.
    chart
        Stabilisation chart: poles over order.
    dropped
        Groups of poles that are no modes, each with its reason.
    band : Hz
        Lowest and highest frequency of the fit.
    reduced_chi_square
        Misfit over the estimated noise. The noise is estimated from the misfit itself, so that 1 only means that the
        error is distributed over channels and lines as noise on forces and responses would be.
    noise
        Estimated noise variances on responses and forces, per test.
    warnings
        Warnings about the fit, one sentence each.
    """

    model: ModalModel
    chart: StabilisationChart
    dropped: tuple[PoleGroup, ...]
    band: Band
    reduced_chi_square: float
    noise: NoiseLevels
    warnings: tuple[str, ...]

    def _note(self) -> str:
        return fit_note(self.band, self.reduced_chi_square)


def fit_subspace(
    recordings: Sequence[BandRecording],
    band: Band,
    *,
    max_order: int = 60,
    block_rows: int | None = None,
    n_modes: int | None = None,
) -> SubspaceFit:
    """Fit a modal model to stacked tests with measured forces.

    Input-output subspace identification (past outputs and inputs as instruments; Van Overschee & De Moor, Subspace
    Identification for Linear Systems, 1996, chapter 4; Verhaegen 1994) on correlation blocks summed over the tests
    gives poles over model order. The chosen poles start a maximum-likelihood fit of the whole-recording spectra in the
    band, with left and right vectors, out-of-band terms, transients, and noise on forces and responses.

    Parameters
    ----------
    recordings
        One recording a test, from :func:`estimation.band_recording`; all of one sample rate and channel layout.
    band
        Lowest and highest frequency, Hz; the modes to be found lie inside.
    max_order
        Highest order of the state-space model (two states a mode).
    block_rows
        Samples of past and future in the correlations; None: 40, and more where few responses must support the highest
        order.
    n_modes
        Keep the ``n_modes`` groups found in most orders; None: as many as there are.

    Raises
    ------
    InputError
        Recordings that cannot be stacked or are too short, or a band outside the band of the recordings.
    MillfrfError
        No pole is stable over the orders, or the refinement does not converge.
    """
    spectra = record_spectra(recordings, band)
    if block_rows is None:  # the observability matrix must hold the highest order: one sensor needs more than three do
        needed = math.ceil(SETTINGS.spare_block_rows * max_order / len(recordings[0].responses))
        block_rows = max(SETTINGS.block_rows, needed)
    blocks = correlation_blocks(recordings, block_rows)
    if not 2 <= max_order < block_rows * blocks.n_responses:
        raise InputError(
            f"highest order {max_order} does not fit {block_rows} block rows of {blocks.n_responses} responses; "
            f"stay between 2 and {block_rows * blocks.n_responses - 1}"
        )
    wide = with_flanks(band, recordings)
    chart = stabilisation_chart(list(subspace_poles(blocks, wide, max_order)), wide)
    groups, dropped = choose_poles(chart)
    inside = [group for group in groups if band[0] < group.frequency < band[1]]
    if not inside:
        raise MillfrfError(
            f"no pole is stable over orders 2 to {max_order} between {band[0]:g} and {band[1]:g} Hz; "
            "widen the band or record longer"
        )
    outer = [group for group in groups if group not in inside]
    inside = sorted(inside, key=lambda group: -group.n_orders)[:n_modes]
    fit, fixed = best_fit(np.array([group.pole for group in [*inside, *outer]]), spectra, band)
    while n_modes is None and len(inside) > 1:
        weakest, needed = weakest_mode(fit, range(len(inside)), 2 * spectra.response.size)
        if needed:
            break
        dropped = (*dropped, replace(inside.pop(weakest), reason="its residue is within the errors of the fit"))
        fit, fixed = best_fit(np.array([group.pole for group in [*inside, *outer]]), spectra, band)
    responses = [channel.degree_of_freedom for channel in recordings[0].responses]
    excitations = [channel.degree_of_freedom for channel in recordings[0].excitations]
    model = modal_model_from(fit, fixed, band, responses, excitations, _unit(recordings[0]))
    warnings = () if fit.converged else (NOT_CONVERGED,)
    model = with_outer_as_residuals(model)
    dropped = tuple(group for group in dropped if band[0] < group.frequency < band[1])
    return SubspaceFit(model, chart.within(band), dropped, band, fit.reduced_chi_square, fit.noise, warnings)


def with_flanks(band: Band, recordings: Sequence[BandRecording]) -> Band:
    """Return the band (Hz) in which modes have flanks in the band of the fit, as far as the recordings reach."""
    reach = SETTINGS.outer_mode_reach
    return band[0] / reach, max(band[1], min(reach * band[1], recordings[0].usable_band))


def _unit(recording: BandRecording) -> str:
    """Return the unit of the model: displacement, for motions of any derivative, over the unit of the excitation."""
    motions = {family_of(channel.quantity)[0] for channel in recording.responses}
    drives = {channel.quantity for channel in recording.excitations}
    for role, kinds in (("responses", motions), ("excitations", drives)):
        if len(kinds) > 1:  # a model has one unit
            raise InputError(f"{role} of different kinds ({', '.join(sorted(kinds))}); choose channels of one kind")
    return f"{SI_UNITS[motions.pop()]}/{SI_UNITS[drives.pop()]}"


def subspace_poles(blocks: CorrelationBlocks, band: Band, max_order: int) -> Iterator[OrderPoles]:
    """Yield poles and shapes of even orders 2 ... ``max_order`` from one factorisation of the correlation blocks.

    The Cholesky factor of the correlations is the transposed triangular factor of the data. Its block of future
    responses on past forces and responses spans the observability matrix, of which each order takes the leading
    singular vectors.
    """
    n_in, n_out, rows = blocks.n_excitations, blocks.n_responses, blocks.block_rows
    power = np.diag(blocks.matrix)
    scale = np.sqrt(np.where(power > 0, power, 1.0))  # a silent channel stays zero
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
        nonzero = np.abs(eigenvalues) > 1e-9  # an eigenvalue of 0 has no pole in continuous time
        poles: Complex = np.log(eigenvalues[nonzero].astype(complex)) * blocks.sample_rate
        shapes = (observability[:n_out] @ modes[:, nonzero]).T * blocks.response_scale
        magnitude = np.abs(poles)
        usable = (poles.imag > 0) & (poles.real < 0) & (magnitude > low) & (magnitude < high)
        length = np.linalg.norm(shapes[usable], axis=1, keepdims=True)
        yield OrderPoles(order, poles[usable], np.asarray(shapes[usable] / length, dtype=complex))
