"""The step from recordings to an FRF file: spectra of each test, stacked, without the sensors' high-pass."""

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from acquisition import Recording
from estimation import (
    CrossSpectra,
    Frf,
    correct_high_pass,
    cross_spectra,
    h1,
    h1_side_by_side,
    h2,
    hv,
    input_independence,
    instrumental_variable,
    known_band,
    settings_for,
    spectra_for_judging,
    sum_tests,
    write_frf,
)
from foundation import InputError

from ...gate import (
    Segmentation,
    check_inputs,
    check_local_frf,
    check_recordings,
    check_sample_rates,
    driven_lines,
    gain_of,
)
from ...progress import Progress, silent
from ...provenance import sources, versions
from .estimate_options import INSTRUMENTAL, LOCAL, TITLES, Estimate, EstimateOptions, check_options
from .instruments import channels_with_instruments, only_inputs
from .local_estimate import band_recordings, local_frf

SPECTRAL: dict[str, Callable[[CrossSpectra], Frf]] = {"h1": h1, "h2": h2, "hv": hv}


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
    rates = [_sample_rate(path, options.stream) for path in paths]
    for path, rate in zip(paths, rates, strict=True):
        if rate != rates[0]:
            raise InputError(
                f"{Path(path).name} was sampled at {rate:g} Hz, {Path(paths[0]).name} at {rates[0]:g} Hz; "
                "stack tests of one sample rate"
            )
    return tuple(_spectra(path, options, progress) for path in paths)


def estimate_recordings(
    paths: Sequence[str | os.PathLike[str]], options: EstimateOptions, progress: Progress = silent
) -> Estimate:
    """FRF over one or many recordings.

    Raises
    ------
    InputError
        A file or option that cannot be used, or inputs that are dependent wherever they have power: fewer tests than
        inputs, or tests that are too much alike.
    """
    check_options(options)
    if options.estimator == LOCAL:
        return _local_estimate(paths, options, progress)
    forces, taken = options.excitations, options
    if options.estimator == INSTRUMENTAL and paths:
        names = (options.excitations, options.responses)
        forces, responses = channels_with_instruments(paths[0], options.stream, names, options.instruments)
        taken = replace(options, excitations=(*forces, *options.instruments), responses=responses)
    doubts = check_recordings(
        paths,
        stream=taken.stream,
        excitations=taken.excitations,
        responses=taken.responses,
        excluding=taken.exclude,
        segments=Segmentation(taken.segment, taken.overlap, taken.window),
        progress=progress,
    )
    tests = spectra_of_tests(paths, taken, progress)
    total = sum_tests(tests)
    if options.estimator == INSTRUMENTAL:
        tests = tuple(only_inputs(test, forces) for test in tests)
        doubts += [*_rate_doubts(paths, tests), *check_inputs(only_inputs(total, options.instruments))]
        frf = instrumental_variable(total, options.instruments)
    else:
        doubts += [*_rate_doubts(paths, tests), *check_inputs(total)]
        frf = SPECTRAL[options.estimator](total) if options.stack == "sum" else h1_side_by_side(tests)
    if total.n_excluded:
        doubts.append(
            f"{total.n_excluded} of {total.n_excluded + total.n_segments} segments hold overload, clipping or dropped "
            "samples and were left out"
        )
    return _finished(frf, tests, doubts, options)


def _local_estimate(paths: Sequence[str | os.PathLike[str]], options: EstimateOptions, progress: Progress) -> Estimate:
    """Estimate by local polynomials over whole recordings; the inputs are judged by spectra as everywhere."""
    assert options.band is not None
    names = (options.excitations, options.responses)
    doubts = check_recordings(
        paths, stream=options.stream, excitations=names[0], responses=names[1], segments=None, progress=progress
    )
    found = band_recordings(paths, names, options.stream, options.band[1], progress)
    tests = tuple(lines_of(test, options.band) for test in spectra_for_judging(found))
    doubts += [*_rate_doubts(paths, tests), *check_inputs(sum_tests(tests))]
    frf = local_frf(found, options.band, progress)
    return _finished(frf, tests, [*doubts, *check_local_frf(frf, len(found))], options)


def _rate_doubts(paths: Sequence[str | os.PathLike[str]], tests: Sequence[CrossSpectra]) -> list[str]:
    gains = [gain_of(test, Path(path).name, test.sample_rate) for test, path in zip(tests, paths, strict=True)]
    return check_sample_rates(gains)


def _finished(frf: Frf, tests: tuple[CrossSpectra, ...], doubts: Sequence[str], options: EstimateOptions) -> Estimate:
    """Take out the sensors' high-pass, and state the band in which the FRF is known."""
    total = sum_tests(tests)
    frf = correct_high_pass(frf, [channel.high_pass_hz for channel in total.responses])
    driven = np.interp(frf.frequencies, total.frequencies, driven_lines(total).astype(float)) >= 0.5
    frf = replace(frf, band=known_band(frf, driven))
    return Estimate(frf, tests, input_independence(total), tuple(doubts), options)


def write_estimate(
    path: str | os.PathLike[str],
    estimate: Estimate,
    recordings: Sequence[str | os.PathLike[str]],
) -> None:
    """Write the FRF with its provenance: recordings, settings, averages, warnings, versions."""
    first, options = estimate.tests[0], estimate.options
    length = first.settings.segment_length / first.sample_rate
    judged_by = {"segment": length} if options.estimator == LOCAL else {}  # it has no segments of its own
    provenance = {
        "step": "estimate",
        "sources": sources(recordings),
        "options": asdict(options) | judged_by,
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
    count = f"{len(recordings)} recording{'s' if len(recordings) != 1 else ''}"
    title = f"{TITLES.get(options.estimator, options.estimator.upper())} of {count}"
    write_frf(path, estimate.frf, title=title, provenance=json.dumps(provenance))


def _sample_rate(path: str | os.PathLike[str], stream: str | None) -> float:
    with Recording(path) as recording:
        return recording.stream(stream).sample_rate


def _spectra(path: str | os.PathLike[str], options: EstimateOptions, progress: Progress) -> CrossSpectra:
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
