"""Step ``estimate``: FRF matrix from recordings."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from annotated_types import Ge, Gt, Lt

from acquisition import Channel, Recording, Stream, all_opened
from estimation import (
    AveragingSettings,
    BandRecording,
    CrossSpectra,
    Frf,
    InputIndependence,
    band_of_channels,
    choose_channels,
    correct_high_pass,
    h1,
    h1_side_by_side,
    h2,
    hv,
    input_independence,
    instrumental_variable,
    known_band,
    local_polynomial,
    only_inputs,
    require_room_for_band,
    spectra_for_judging,
    spectra_in_band,
    spectra_of_tests,
    sum_tests,
    write_frf,
)
from millfrf.core import InputError, MillfrfError, Result, Summary, counted, doubts_line
from millfrf.core.progress import progress
from millfrf.core.provenance import sources, versions
from millfrf.core.steps import Band, File, Names, Writes, names_of, step
from millfrf.core.terminal import say_written, tell, warn
from millfrf.gate import (
    Gain,
    Segmentation,
    check_consistency,
    check_constant_modes,
    check_inputs,
    check_local_frf,
    check_recordings,
    check_sample_rates,
    driven_lines,
    gain_of,
    recorded_cuts,
)

from .answers import frf_answer, size_of
from .given import RecordingGiven

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Estimator = Literal["h1", "h2", "hv", "instrumental-variable", "local-polynomial"]
INSTRUMENTAL, LOCAL = "instrumental-variable", "local-polynomial"
TITLES = {INSTRUMENTAL: "FRF by instrumental variables", LOCAL: "FRF by local polynomials"}
SPECTRAL: Mapping[str, Callable[[CrossSpectra], Frf]] = {"h1": h1, "h2": h2, "hv": hv}


@step
def estimate(
    *recordings: RecordingGiven,
    out: Annotated[File | None, Writes(suffixes=(".h5", ".hdf5"), needed=True)] = None,
    segment: Annotated[float, Gt(0)] = 8.0,
    overlap: Annotated[float, Ge(0), Lt(1)] = 0.5,
    window: Literal["hann", "hamming", "boxcar"] = "hann",
    stack: Literal["sum", "side-by-side"] = "sum",
    excitations: Names = (),
    responses: Names = (),
    band: Band | None = None,
    stream: str | None = None,
    estimator: Estimator = "h1",
    exclude: bool = False,
    instruments: Names = (),
) -> "Estimate":
    """FRF matrix over one or many tests of one set-up, with coherence and covariance: ``X = H F``.

    h1: noise on the responses. h2: noise on the excitations. hv: noise on both. instrumental-variable: a disturbance
    moves the structure and, by feedback, changes the force; the instruments are independent of it. local-polynomial:
    whole records instead of segments, without leakage, for short records and forces that are rough in frequency.

    Parameters
    ----------
    recordings
        Recordings of one set-up, one a test.
    out
        FRF file to write.
    segment : s
        Duration of a segment.
    overlap
        Overlap of successive segments as a share of their duration, 0 to below 1.
    window
        Window of the segments.
    stack
        Stacking of tests: their spectra are summed, or their segments are put side by side.
    excitations
        Excitation channels; without it forces and voltages.
    responses
        Response channels; without it accelerations, velocities and displacements.
    band : Hz
        Lowest and highest frequency to keep; without it all lines.
    stream
        Sample clock; needed where a recording has several.
    estimator
        Estimator of the FRF.
    exclude
        Leave out segments with overload, clipping or dropped samples.
    instruments
        Channels that drive the forces and are independent of the disturbance, for instrumental-variable.

    Returns
    -------
    Estimate
        The FRF, the spectra of each test and the warnings.

    Raises
    ------
    InputError
        A recording or an option that cannot be used, or inputs that are dependent wherever they have power.

    Examples
    --------
    ::

        $ millfrf estimate rec1.h5 rec2.h5 rec3.h5 --out frf.h5
    """
    options = EstimateOptions(
        segment, overlap, window, stack, names_of(excitations), names_of(responses),
        band, stream, estimator, exclude, names_of(instruments),
    )  # fmt: skip
    options.check()
    if not recordings:
        raise InputError("no recording given; name at least one")
    with all_opened(recordings) as opened_recordings:
        result = (_local if estimator == LOCAL else _from_spectra)(opened_recordings, options)
        moving = _check_constant_modes(opened_recordings, options, result.frf.band)
        result = replace(result, warnings=(*moving, *result.warnings))
        paths = [recording.path for recording in opened_recordings]
    if out is not None:
        write_estimate(out, result, sources(paths), recorded_cuts(paths))
    warn(result.warnings)
    frf = result.frf
    tell(lambda: frf_answer(frf))
    say_written([out], f"{size_of(frf)}, {frf.frequencies[0]:g} to {frf.frequencies[-1]:g} Hz")
    return result


@dataclass(frozen=True)
class EstimateOptions:
    """Options of :func:`estimate`; stored with the FRF, and passed on by campaigns."""

    segment: float
    overlap: float
    window: str
    stack: str
    excitations: tuple[str, ...]
    responses: tuple[str, ...]
    band: tuple[float, float] | None
    stream: str | None
    estimator: str
    exclude: bool
    instruments: tuple[str, ...]

    def check(self) -> None:
        """Refuse options that contradict each other."""
        if self.stack != "sum" and self.estimator != "h1":
            raise InputError(f"estimator {self.estimator} takes summed tests only; use --stack sum")
        if self.estimator == INSTRUMENTAL and not self.instruments:
            raise InputError(
                f"estimator {INSTRUMENTAL} needs instruments: name channels that drive the forces and that no "
                "disturbance reaches with --instrument"
            )
        if self.instruments and self.estimator != INSTRUMENTAL:
            raise InputError(f"--instrument is for --estimator {INSTRUMENTAL}, not for {self.estimator}; leave it out")
        if self.estimator == LOCAL and self.band is None:
            raise InputError(f"estimator {LOCAL} gives every line of the whole records: state the band, --band LO HI")
        if self.estimator == LOCAL and self.exclude:
            raise InputError(
                f"estimator {LOCAL} has no segments to leave out: drop --exclude, or use another estimator"
            )

    def settings(self, recording: Recording) -> AveragingSettings:
        """Settings of the spectra of a test; with instruments, all channels are named."""
        excitations, responses = self.excitations, self.responses
        if self.estimator == INSTRUMENTAL:
            forces, responses = _channels_without_instruments(recording, self)
            excitations = (*forces, *self.instruments)
        return AveragingSettings(
            self.segment, self.overlap, self.window, excitations, responses, self.band, self.stream, self.exclude
        )


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Result):
    """An estimated FRF with the spectra that it was computed from.

    Parameters
    ----------
    frf
        FRF in the quantity of the recordings (accelerance from accelerations).
    tests
        Spectra, test by test.
    independence
        Independence of the stacked inputs, line by line.
    warnings
        Warnings about the FRF, one sentence each.
    options
        Options of the estimate.
    """

    frf: Frf
    tests: tuple[CrossSpectra, ...]
    independence: InputIndependence
    warnings: tuple[str, ...]
    options: EstimateOptions

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw entries of the FRF and return the axes; see :func:`millfrf.figures.draw_frf` for the choices."""
        return self.frf.plot(axes, **choices)

    def _summary(self) -> Summary:
        frf, averages = self.frf, sum(test.effective_averages for test in self.tests)
        shape = f"{counted(len(frf.responses), 'response')} x {counted(len(frf.excitations), 'excitation')}"
        holds = "" if frf.band is None else f"; holds in {frf.band[0]:.4g} to {frf.band[1]:.4g} Hz"
        rows = tuple(
            (str(number + 1), str(test.n_segments), f"{test.effective_averages:.3g}", str(test.n_excluded))
            for number, test in enumerate(self.tests)
        )
        return Summary(
            f"Estimate by {self.options.estimator}: {counted(len(self.tests), 'test')} worth {averages:.3g} averages",
            (
                f"frf: {frf.quantity} in {frf.unit}, {shape}, {counted(len(frf.frequencies), 'line')}{holds}",
                *doubts_line(self.warnings),
            ),
            ("test", "segments", "effective averages", "left out"),
            rows,
        )


def _from_spectra(recordings: Sequence[Recording], options: EstimateOptions) -> Estimate:
    """Estimate the FRF from averaged spectra of segments."""
    settings = options.settings(recordings[0])
    warnings = check_recordings(
        recordings,
        stream=settings.stream,
        excitations=settings.excitations,
        responses=settings.responses,
        excluding=settings.exclude,
        segments=Segmentation(settings.segment, settings.overlap, settings.window),
    )
    tests = spectra_of_tests(recordings, settings)
    warnings = [*check_consistency(recordings, settings.stream, settings.excitations, settings.responses), *warnings]
    gains = [
        gain_of_test(test, recording.path.name, options) for test, recording in zip(tests, recordings, strict=True)
    ]
    return estimate_of_spectra(tests, gains, warnings, options)


def estimate_of_spectra(
    tests: Sequence[CrossSpectra], gains: Sequence[Gain], doubts: Sequence[str], options: EstimateOptions
) -> Estimate:
    """FRF from spectra of tests, or from sums of such spectra; side by side each must be of one test.

    The spectra have the channels of :meth:`EstimateOptions.settings`; ``doubts`` are warnings about the recordings.
    """
    total = sum_tests(tests)
    without = tuple(without_instruments(test, options) for test in tests)
    warnings = [*doubts, *check_sample_rates(gains)]
    if options.estimator == INSTRUMENTAL:
        warnings += check_inputs(only_inputs(total, options.instruments))
        frf = instrumental_variable(total, options.instruments)
    else:
        warnings += check_inputs(total)
        frf = SPECTRAL[options.estimator](total) if options.stack == "sum" else h1_side_by_side(without)
    if total.n_excluded:
        warnings.append(
            f"{total.n_excluded} of {total.n_excluded + total.n_segments} segments hold overload, clipping or dropped "
            "samples and were left out"
        )
    return _completed(frf, without, warnings, options)


def _local(recordings: Sequence[Recording], options: EstimateOptions) -> Estimate:
    """Estimate the FRF by local polynomials over whole recordings; check the independence of inputs by spectra."""
    band = options.band
    assert band is not None
    for recording in recordings:  # memory is checked before anything is read
        stream = recording.stream(options.stream)
        forces, motions = _channels(stream, options)
        require_room_for_band(stream, len(forces) + len(motions), band[1])
    warnings = check_recordings(
        recordings, stream=options.stream, excitations=options.excitations, responses=options.responses
    )
    warnings += check_consistency(recordings, options.stream, options.excitations, options.responses)
    records = _band_recordings(recordings, options, band[1])
    tests = tuple(spectra_in_band(test, band) for test in spectra_for_judging(records))
    gains = [
        gain_of_test(test, recording.path.name, options) for test, recording in zip(tests, recordings, strict=True)
    ]
    warnings += [*check_sample_rates(gains), *check_inputs(sum_tests(tests))]
    with progress(f"local polynomials, {band[0]:g} to {band[1]:g} Hz"):
        frf = local_polynomial(records, band)
    return _completed(frf, tests, [*warnings, *check_local_frf(frf, len(records))], options)


def _check_constant_modes(
    recordings: Sequence[Recording], options: EstimateOptions, band: tuple[float, float] | None
) -> list[str]:
    """Return a warning if modes move; none where recordings cannot be compared or held in memory for the test."""
    if band is None:
        return []
    try:
        for recording in recordings:
            stream = recording.stream(options.stream)
            forces, motions = _channels(stream, options)
            require_room_for_band(stream, len(forces) + len(motions), band[1])
        records = _band_recordings(recordings, options, band[1])
    except MillfrfError:
        return []
    with progress(f"motion of modes, {band[0]:.4g} to {band[1]:.4g} Hz"):
        return check_constant_modes(records, band)


def _channels(stream: Stream, options: EstimateOptions) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    return choose_channels(stream, options.excitations or None, options.responses or None)


def _band_recordings(
    recordings: Sequence[Recording], options: EstimateOptions, highest: float
) -> tuple[BandRecording, ...]:
    """Read each recording up to the frequency ``highest`` (Hz); refuse recordings with different sample rates."""
    records = []
    for recording in recordings:
        stream = recording.stream(options.stream)
        channels = _channels(stream, options)
        with progress(f"reading {recording.path.name}", stream.n_samples) as update:
            records.append(band_of_channels(stream, *channels, highest, update))
    for recording, record in zip(recordings, records, strict=True):
        if record.rate != records[0].rate:
            raise InputError(
                f"{recording.path.name} and {recordings[0].path.name} have different rates; stack tests of one rate"
            )
    return tuple(records)


def _channels_without_instruments(
    recording: Recording, options: EstimateOptions
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of forces and responses that are no instruments; refuse if no force or no response remains."""
    stream, instruments = recording.stream(options.stream), options.instruments
    stream.columns(instruments)  # refuses unknown names
    forces, responses = (
        tuple(channel.name for channel in channels if channel.name not in instruments)
        for channels in _channels(stream, options)
    )
    if not forces or not responses:
        role = "excites" if not forces else "responds"
        raise InputError(
            f"no channel {role} besides the instrument{'s' if len(instruments) > 1 else ''} {', '.join(instruments)}; "
            f"name {'--excitation' if not forces else '--response'} channels and others as --instrument"
        )
    return forces, responses


def gain_of_test(test: CrossSpectra, name: str, options: EstimateOptions) -> Gain:
    """Gain of one test, by which stated sample rates are compared; ``name`` of its file for messages."""
    return gain_of(without_instruments(test, options), name, test.sample_rate)


def without_instruments(test: CrossSpectra, options: EstimateOptions) -> CrossSpectra:
    """The spectra of a test without the instruments among its excitations."""
    names = [channel.name for channel in test.excitations if channel.name not in options.instruments]
    return only_inputs(test, names) if options.estimator == INSTRUMENTAL else test


def _completed(
    frf: Frf, tests: tuple[CrossSpectra, ...], warnings: Sequence[str], options: EstimateOptions
) -> Estimate:
    """Correct an FRF for the high-pass of the sensors, and set the band in which the FRF is known."""
    total = sum_tests(tests)
    corners = [[channel.high_pass_hz for channel in channels] for channels in (total.responses, total.excitations)]
    frf = correct_high_pass(frf, *corners)
    driven = np.interp(frf.frequencies, total.frequencies, driven_lines(total).astype(float)) >= 0.5
    frf = replace(frf, band=known_band(frf, driven))
    return Estimate(frf, tests, input_independence(total), tuple(warnings), options)


def write_estimate(
    path: File, estimate: Estimate, recordings: Sequence[Mapping[str, str]], cuts: Mapping[str, Any]
) -> None:
    """Write the FRF with its provenance: recordings and their cuts, settings, averages, warnings, versions."""
    first, options = estimate.tests[0], estimate.options
    length = first.settings.segment_length / first.sample_rate
    # local polynomials have no segments: the stored length is that of the spectra that checked the inputs
    checked_by = {"segment": length} if options.estimator == LOCAL else {}
    provenance = {
        "step": "estimate",
        "sources": list(recordings),
        "cuts": dict(cuts),
        "options": asdict(options) | checked_by,
        "settings": asdict(first.settings),
        "sample_rate_hz": first.sample_rate,
        "excitation_channels": [channel.name for channel in first.excitations],
        "response_channels": [channel.name for channel in first.responses],
        "n_tests": sum(test.n_tests for test in estimate.tests),
        "n_segments": sum(test.n_segments for test in estimate.tests),
        "effective_averages": sum(test.effective_averages for test in estimate.tests),
        "warnings": list(estimate.warnings),
        "versions": versions(),
    }
    title = f"{TITLES.get(options.estimator, options.estimator.upper())} of {counted(len(recordings), 'recording')}"
    write_frf(path, estimate.frf, title=title, provenance=json.dumps(provenance))
