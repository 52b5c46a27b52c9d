"""From recordings to an FRF file: spectra test by test, stacked, with the sensors' high-pass taken out."""

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from acquisition import Recording
from estimation import (
    CrossSpectra,
    Frf,
    InputIndependence,
    correct_high_pass,
    cross_spectra,
    h1,
    h1_side_by_side,
    h2,
    hv,
    input_independence,
    known_band,
    settings_for,
    sum_tests,
    write_frf,
)
from foundation import InputError

from ..gate import Segmentation, check_inputs, check_recordings, check_sample_rates, driven_lines, gain_of
from ..progress import Watch, silent
from ..provenance import sources, versions

STACKS = ("sum", "side-by-side")
ESTIMATORS: dict[str, Callable[[CrossSpectra], Frf]] = {"h1": h1, "h2": h2, "hv": hv}


@dataclass(frozen=True)
class EstimateOptions:
    """How recordings are turned into an FRF.

    Parameters
    ----------
    segment
        Duration of a segment, s.
    overlap, window
        As in :class:`estimation.SpectralSettings`.
    stack
        ``sum`` or ``side-by-side``.
    excitations, responses
        Channel names; empty: chosen by quantity.
    band
        Lines to keep, Hz; None: all.
    stream
        Sample clock; None: the only one.
    estimator
        ``h1``, ``h2`` or ``hv``; H2 and Hv sum the tests.
    exclude
        Leave out segments with overload, clipping or dropped samples.
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


@dataclass(frozen=True)
class Estimate:
    """An FRF with what it was made from.

    Parameters
    ----------
    frf
        In the recordings' own quantity (accelerance from accelerations).
    tests
        Spectra test by test.
    independence
        Of the stacked inputs.
    warnings
        One sentence each.
    """

    frf: Frf
    tests: tuple[CrossSpectra, ...]
    independence: InputIndependence
    warnings: tuple[str, ...]


def spectra_of_tests(
    paths: Sequence[str | os.PathLike[str]], options: EstimateOptions, watch: Watch = silent
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
    return tuple(_spectra(path, options, watch) for path in paths)


def estimate_recordings(
    paths: Sequence[str | os.PathLike[str]], options: EstimateOptions, watch: Watch = silent
) -> Estimate:
    """FRF over one or many recordings.

    Raises
    ------
    InputError
        A file or option that cannot be used, or inputs that are dependent wherever they have power: fewer tests than
        inputs, or tests that are too much alike.
    """
    if options.stack not in STACKS:
        raise InputError(f"unknown stack {options.stack!r}; use one of {', '.join(STACKS)}")
    if options.estimator not in ESTIMATORS:
        raise InputError(f"unknown estimator {options.estimator!r}; use one of {', '.join(ESTIMATORS)}")
    if options.stack != "sum" and options.estimator != "h1":
        raise InputError(f"estimator {options.estimator} takes summed tests only; use --stack sum")
    doubts = check_recordings(
        paths,
        stream=options.stream,
        excitations=options.excitations,
        responses=options.responses,
        excluding=options.exclude,
        segments=Segmentation(options.segment, options.overlap, options.window),
        watch=watch,
    )
    tests = spectra_of_tests(paths, options, watch)
    names = [Path(path).name for path in paths]
    doubts += check_sample_rates([gain_of(t, name, t.sample_rate) for t, name in zip(tests, names, strict=True)])
    total = sum_tests(tests)
    warnings = [*doubts, *check_inputs(total)]
    frf = ESTIMATORS[options.estimator](total) if options.stack == "sum" else h1_side_by_side(tests)
    frf = correct_high_pass(frf, [channel.high_pass_hz for channel in total.responses])
    frf = replace(frf, band=known_band(frf, driven_lines(total)))
    if total.n_excluded:
        warnings.append(
            f"{total.n_excluded} of {total.n_excluded + total.n_segments} segments hold overload, clipping or dropped "
            "samples and were left out"
        )
    return Estimate(frf, tests, input_independence(total), tuple(warnings))


def write_estimate(
    path: str | os.PathLike[str],
    estimate: Estimate,
    recordings: Sequence[str | os.PathLike[str]],
    options: EstimateOptions,
) -> None:
    """Write the FRF with its provenance: recordings, settings, averages, warnings, versions."""
    first = estimate.tests[0]
    provenance = {
        "step": "estimate",
        "sources": sources(recordings),
        "options": asdict(options),
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
    title = f"{options.estimator.upper()} of {len(recordings)} recording{'s' if len(recordings) != 1 else ''}"
    write_frf(path, estimate.frf, title=title, provenance=json.dumps(provenance))


def _sample_rate(path: str | os.PathLike[str], stream: str | None) -> float:
    with Recording(path) as recording:
        return recording.stream(stream).sample_rate


def _spectra(path: str | os.PathLike[str], options: EstimateOptions, watch: Watch) -> CrossSpectra:
    with Recording(path) as recording:
        source = recording.stream(options.stream)
        settings = settings_for(source.sample_rate, options.segment, overlap=options.overlap, window=options.window)
        with watch(f"spectra of {Path(path).name}", source.n_samples) as update:
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
