"""Spectra of recordings, test by test, and local-polynomial FRFs of whole recordings."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from acquisition import Recording
from estimation import (
    BandRecording,
    CrossSpectra,
    Frf,
    InputIndependence,
    band_of_channels,
    choose_channels,
    cross_spectra,
    local_polynomial,
    require_room_for_band,
    settings_for,
)
from millfrf.core import Band, InputError, Result, Summary, counted, doubts_line
from millfrf.core.progress import Progress, silent
from millfrf.gate import Gain, gain_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes


STACKS = ("sum", "side-by-side")
INSTRUMENTAL, LOCAL = "instrumental-variable", "local-polynomial"
ESTIMATORS = ("h1", "h2", "hv", INSTRUMENTAL, LOCAL)
TITLES = {INSTRUMENTAL: "FRF by instrumental variables", LOCAL: "FRF by local polynomials"}


@dataclass(frozen=True)
class EstimateOptions:
    """Options with which recordings are turned into an FRF.

    Parameters
    ----------
    segment : s
        Duration of a segment.
    overlap, window
        Overlap and window of the segments, as in :class:`estimation.SpectralSettings`.
    stack
        Way of stacking tests: ``sum`` or ``side-by-side``.
    excitations, responses
        Names of the channels; empty: chosen by quantity.
    band : Hz
        Lowest and highest frequency of the lines to keep; None: all.
    stream
        Name of the sample clock; None: the only one.
    estimator
        Estimator, one of :data:`ESTIMATORS`; all but H1 take the tests together.
    exclude
        Whether to leave out segments with overload, clipping or dropped samples.
    instruments
        Channels that drive the forces and that no disturbance reaches, for ``instrumental-variable``.
    """

    segment: float = 8.0
    overlap: float = 0.5
    window: str = "hann"
    stack: str = "sum"
    excitations: tuple[str, ...] = ()
    responses: tuple[str, ...] = ()
    band: tuple[float, float] | None = None
    stream: str | None = None
    estimator: str = "h1"
    exclude: bool = False
    instruments: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Result):
    """An estimated FRF, with the spectra it was made from.

    Parameters
    ----------
    frf
        FRF in the recordings' own quantity (accelerance from accelerations).
    tests
        Spectra, test by test.
    independence
        Independence of the stacked inputs, line by line.
    warnings
        Doubts about the FRF, one sentence each.
    options
        How the recordings were turned into the FRF.
    """

    frf: Frf
    tests: tuple[CrossSpectra, ...]
    independence: InputIndependence
    warnings: tuple[str, ...]
    options: EstimateOptions

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw entries of the FRF and return the axes; see :func:`millfrf.figures.frf.draw_frf` for the choices."""
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


def check_options(options: EstimateOptions) -> None:
    """Refuse unknown names, and options that contradict each other.

    Raises
    ------
    InputError
        With the option and the remedy.
    """
    if options.stack not in STACKS:
        raise InputError(f"unknown stack {options.stack!r}; use one of {', '.join(STACKS)}")
    if options.estimator not in ESTIMATORS:
        raise InputError(f"unknown estimator {options.estimator!r}; use one of {', '.join(ESTIMATORS)}")
    if options.stack != "sum" and options.estimator != "h1":
        raise InputError(f"estimator {options.estimator} takes summed tests only; use --stack sum")
    if options.estimator == INSTRUMENTAL and not options.instruments:
        raise InputError(
            f"estimator {INSTRUMENTAL} needs instruments: name channels that drive the forces and that no disturbance "
            "reaches with --instrument"
        )
    if options.instruments and options.estimator != INSTRUMENTAL:
        raise InputError(f"--instrument is for --estimator {INSTRUMENTAL}, not for {options.estimator}; leave it out")
    if options.estimator == LOCAL and options.band is None:
        raise InputError(f"estimator {LOCAL} gives every line of the whole records: say which with --band LO HI")
    if options.estimator == LOCAL and options.exclude:
        raise InputError(f"estimator {LOCAL} has no segments to leave out: drop --exclude, or use another estimator")


def channels_with_instruments(
    path: str | os.PathLike[str],
    stream: str | None,
    names: tuple[Sequence[str], Sequence[str]],
    instruments: Sequence[str],
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of forces and of responses, without the instruments among them.

    Raises
    ------
    InputError
        An instrument that is not there, or none left beside them.
    """
    with Recording(path) as recording:
        source = recording.stream(stream)
        source.columns(instruments)  # refuses names that are not there
        chosen = choose_channels(source, names[0] or None, names[1] or None)
    forces, responses = (tuple(one.name for one in each if one.name not in instruments) for each in chosen)
    if not forces or not responses:
        role = "excites" if not forces else "responds"
        raise InputError(
            f"no channel {role} beside the instrument{'s' if len(instruments) > 1 else ''} {', '.join(instruments)}; "
            f"name {'--excitation' if not forces else '--response'} channels and others as --instrument"
        )
    return forces, responses


def only_inputs(spectra: CrossSpectra, names: Sequence[str]) -> CrossSpectra:
    """The spectra with some of the excitations only."""
    kept = [number for number, channel in enumerate(spectra.excitations) if channel.name in names]
    return replace(
        spectra,
        input_spectra=spectra.input_spectra[:, kept][:, :, kept],
        cross_spectra=spectra.cross_spectra[:, :, kept],
        excitations=tuple(spectra.excitations[number] for number in kept),
    )


def spectra_of_tests(
    paths: Sequence[str | os.PathLike[str]], options: EstimateOptions, progress: Progress = silent
) -> tuple[CrossSpectra, ...]:
    """Spectra of each recording on the lines that are wanted.

    Raises
    ------
    InputError
        A file that cannot be used, or sample rates that differ.
    """
    if not paths:
        raise InputError("no recording given; name at least one")
    check_equal_rates([Path(path).name for path in paths], [_sample_rate(path, options.stream) for path in paths])
    return tuple(spectra_of_test(path, options, progress) for path in paths)


def with_instruments(path: str | os.PathLike[str], options: EstimateOptions) -> EstimateOptions:
    """Options that name the channels to read where an estimate has instruments: forces, instruments, responses.

    Raises
    ------
    InputError
        An instrument that the recording does not have, or no channel left beside them.
    """
    if options.estimator != INSTRUMENTAL:
        return options
    names = (options.excitations, options.responses)
    forces, responses = channels_with_instruments(path, options.stream, names, options.instruments)
    return replace(options, excitations=(*forces, *options.instruments), responses=responses)


def gain_of_test(test: CrossSpectra, name: str, options: EstimateOptions) -> Gain:
    """Gain from the forces of one test, by which sample rates are compared; ``name`` is that of its file."""
    return gain_of(without_instruments(test, options), name, test.sample_rate)


def without_instruments(test: CrossSpectra, options: EstimateOptions) -> CrossSpectra:
    """The spectra of a test without the instruments among its excitations."""
    names = [channel.name for channel in test.excitations if channel.name not in options.instruments]
    return only_inputs(test, names) if options.estimator == INSTRUMENTAL else test


def _sample_rate(path: str | os.PathLike[str], stream: str | None) -> float:
    with Recording(path) as recording:
        return recording.stream(stream).sample_rate


def check_equal_rates(names: Sequence[str], rates: Sequence[float]) -> None:
    """Refuse tests of different sample rates (Hz).

    Raises
    ------
    InputError
        With both names.
    """
    for name, rate in zip(names, rates, strict=True):
        if rate != rates[0]:
            raise InputError(
                f"{name} was sampled at {rate:g} Hz, {names[0]} at {rates[0]:g} Hz; stack tests of one sample rate"
            )


def spectra_of_test(
    path: str | os.PathLike[str],
    options: EstimateOptions,
    progress: Progress = silent,
    segments: tuple[int, int] | None = None,
) -> CrossSpectra:
    """Spectra of one recording, or of some of its segments, on the lines that are wanted.

    Raises
    ------
    InputError
        A file that cannot be used.
    """
    with Recording(path) as recording:
        source = recording.stream(options.stream)
        settings = settings_for(source.sample_rate, options.segment, overlap=options.overlap, window=options.window)
        with progress(f"spectra of {Path(path).name}", source.n_samples) as update:
            spectra = cross_spectra(
                recording,
                settings,
                stream=options.stream,
                excitations=options.excitations or None,
                responses=options.responses or None,
                exclude_unusable=options.exclude,
                segments=segments,
                progress=update,
            )
    return spectra if options.band is None else lines_of(spectra, options.band)


def lines_of(spectra: CrossSpectra, band: tuple[float, float]) -> CrossSpectra:
    """The lines of spectra inside a band (Hz).

    Raises
    ------
    InputError
        None lies inside.
    """
    low, high = band
    f = spectra.frequencies
    inside = (f >= low) & (f <= high)
    if not inside.any():
        raise InputError(
            f"no line lies between {low:g} and {high:g} Hz (the spectra have 0 to {f[-1]:g} Hz); widen --band"
        )
    return replace(
        spectra,
        frequencies=f[inside],
        input_spectra=spectra.input_spectra[inside],
        cross_spectra=spectra.cross_spectra[inside],
        output_spectra=spectra.output_spectra[inside],
    )


def require_room_for_recordings(
    paths: Sequence[str | os.PathLike[str]],
    names: tuple[Sequence[str], Sequence[str]],
    stream: str | None,
    highest: float,
) -> None:
    """Refuse recordings that :func:`band_recordings` has no memory for, before they are looked through.

    Parameters
    ----------
    paths
        Recordings that will be read.
    names
        Names of excitations and responses; empty: chosen by quantity.
    stream
        Sample clock; None: the only one of each recording.
    highest
        Upper end of the band, Hz.

    Raises
    ------
    InputError
        A recording is too long, has not the channels, or the band is beyond its sample rate.
    """
    for path in paths:
        with Recording(path) as recording:
            source = recording.stream(stream)
            forces, motions = choose_channels(source, names[0] or None, names[1] or None)
            require_room_for_band(source, len(forces) + len(motions), highest)


def band_recordings(
    paths: Sequence[str | os.PathLike[str]],
    names: tuple[Sequence[str], Sequence[str]],
    stream: str | None,
    highest: float,
    progress: Progress,
) -> tuple[BandRecording, ...]:
    """Read each recording up to ``highest`` (Hz).

    Parameters
    ----------
    names
        Names of excitations and responses; empty: chosen by quantity.

    Raises
    ------
    InputError
        Channels that are not there, a band beyond the sample rate, or rates that differ.
    """
    found = []
    for path in paths:
        with Recording(path) as recording:
            source = recording.stream(stream)
            channels = choose_channels(source, names[0] or None, names[1] or None)
            with progress(f"reading {Path(path).name}", source.n_samples) as update:
                found.append(band_of_channels(source, *channels, highest, update))
    for path, one in zip(paths, found, strict=True):
        if one.rate != found[0].rate:
            raise InputError(
                f"{Path(path).name} and {Path(paths[0]).name} have other sample rates; stack tests of one rate"
            )
    return tuple(found)


def local_frf(recordings: Sequence[BandRecording], band: Band, progress: Progress) -> Frf:
    """The FRF on every Fourier line of the band."""
    with progress(f"local polynomials, {band[0]:g} to {band[1]:g} Hz"):
        return local_polynomial(recordings, band)
