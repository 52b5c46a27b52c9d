"""Step ``estimate``: FRF matrix from recordings."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from estimation import (
    CrossSpectra,
    Frf,
    correct_high_pass,
    h1,
    h1_side_by_side,
    h2,
    hv,
    input_independence,
    instrumental_variable,
    known_band,
    spectra_for_judging,
    sum_tests,
    write_frf,
)
from millfrf.core import InputError
from millfrf.core.progress import Progress, silent
from millfrf.core.provenance import sources, versions
from millfrf.gate import (
    Gain,
    Segmentation,
    check_inputs,
    check_local_frf,
    check_recordings,
    check_sample_rates,
    driven_lines,
)

from .test_spectra import (
    INSTRUMENTAL,
    LOCAL,
    TITLES,
    Estimate,
    EstimateOptions,
    band_recordings,
    check_options,
    gain_of_test,
    lines_of,
    local_frf,
    only_inputs,
    require_room_for_recordings,
    spectra_of_tests,
    with_instruments,
    without_instruments,
)

SPECTRAL: dict[str, Callable[[CrossSpectra], Frf]] = {"h1": h1, "h2": h2, "hv": hv}


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
    if not paths:
        raise InputError("no recording given; name at least one")
    taken = with_instruments(paths[0], options)
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
    gains = [gain_of_test(test, Path(path).name, options) for test, path in zip(tests, paths, strict=True)]
    return estimate_of_spectra(tests, gains, doubts, options)


def estimate_of_spectra(
    tests: Sequence[CrossSpectra], gains: Sequence[Gain], doubts: Sequence[str], options: EstimateOptions
) -> Estimate:
    """FRF from spectra of tests, or from sums of such spectra.

    Parameters
    ----------
    tests
        Spectra with the channels of :func:`with_instruments`; side by side each must be of one test.
    gains
        Gain of each test, see :func:`gain_of_test`.
    doubts
        Doubts about the recordings.
    options
        How tests are stacked, and the estimator.

    Raises
    ------
    InputError
        Tests that cannot be stacked, or inputs that are dependent wherever they have power.
    """
    total = sum_tests(tests)
    kept = tuple(without_instruments(test, options) for test in tests)
    found = [*doubts, *check_sample_rates(gains)]
    if options.estimator == INSTRUMENTAL:
        found += check_inputs(only_inputs(total, options.instruments))
        frf = instrumental_variable(total, options.instruments)
    else:
        found += check_inputs(total)
        frf = SPECTRAL[options.estimator](total) if options.stack == "sum" else h1_side_by_side(kept)
    if total.n_excluded:
        found.append(
            f"{total.n_excluded} of {total.n_excluded + total.n_segments} segments hold overload, clipping or dropped "
            "samples and were left out"
        )
    return _finished(frf, kept, found, options)


def _local_estimate(paths: Sequence[str | os.PathLike[str]], options: EstimateOptions, progress: Progress) -> Estimate:
    """Estimate by local polynomials over whole recordings; the inputs are judged by spectra as everywhere."""
    assert options.band is not None
    names = (options.excitations, options.responses)
    require_room_for_recordings(paths, names, options.stream, options.band[1])
    doubts = check_recordings(
        paths, stream=options.stream, excitations=names[0], responses=names[1], segments=None, progress=progress
    )
    found = band_recordings(paths, names, options.stream, options.band[1], progress)
    tests = tuple(lines_of(test, options.band) for test in spectra_for_judging(found))
    gains = [gain_of_test(test, Path(path).name, options) for test, path in zip(tests, paths, strict=True)]
    doubts += [*check_sample_rates(gains), *check_inputs(sum_tests(tests))]
    frf = local_frf(found, options.band, progress)
    return _finished(frf, tests, [*doubts, *check_local_frf(frf, len(found))], options)


def _finished(frf: Frf, tests: tuple[CrossSpectra, ...], doubts: Sequence[str], options: EstimateOptions) -> Estimate:
    """Take out the sensors' high-pass, and state the band in which the FRF is known."""
    total = sum_tests(tests)
    corners = [[one.high_pass_hz for one in channels] for channels in (total.responses, total.excitations)]
    frf = correct_high_pass(frf, *corners)
    driven = np.interp(frf.frequencies, total.frequencies, driven_lines(total).astype(float)) >= 0.5
    frf = replace(frf, band=known_band(frf, driven))
    return Estimate(frf, tests, input_independence(total), tuple(doubts), options)


def write_estimate(
    path: str | os.PathLike[str],
    estimate: Estimate,
    recordings: Sequence[str | os.PathLike[str]],
    stated: Sequence[Mapping[str, str]] | None = None,
) -> None:
    """Write the FRF with its provenance: recordings, settings, averages, warnings, versions.

    Parameters
    ----------
    path
        File to write.
    estimate
        FRF with what it was made from.
    recordings
        Recordings it was made from.
    stated
        Name and SHA-256 of each, where they are known; None: the files are read.
    """
    first, options = estimate.tests[0], estimate.options
    length = first.settings.segment_length / first.sample_rate
    judged_by = {"segment": length} if options.estimator == LOCAL else {}  # it has no segments of its own
    provenance = {
        "step": "estimate",
        "sources": sources(recordings) if stated is None else list(stated),
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
