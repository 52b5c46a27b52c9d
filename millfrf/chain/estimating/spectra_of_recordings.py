"""Spectra of recordings, test by test, on the lines that an estimate wants."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from acquisition import Recording
from estimation import CrossSpectra, cross_spectra, settings_for
from millfrf.core import InputError

from ...gate import Gain, gain_of
from ...progress import Progress, silent
from .estimate_options import INSTRUMENTAL, EstimateOptions
from .instruments import channels_with_instruments, only_inputs


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
