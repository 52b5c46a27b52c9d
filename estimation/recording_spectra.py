"""Averaged spectra of recordings, test by test, on the lines that an estimate keeps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from acquisition import RecordingFile, opened, path_of
from millfrf.core import Band, InputError
from millfrf.core.progress import progress

from .spectra.cross_spectra import CrossSpectra, settings_for
from .spectra.welch import cross_spectra


@dataclass(frozen=True)
class AveragingSettings:
    """How the spectra of a test are computed.

    Parameters
    ----------
    segment : s
        Duration of a segment.
    overlap, window
        Overlap and window of the segments, as in :class:`estimation.SpectralSettings`.
    excitations, responses
        Names of the channels; empty: chosen by quantity.
    band : Hz
        Lowest and highest frequency of the lines to keep; None: all.
    stream
        Name of the sample clock; None: the only one.
    exclude
        Whether segments with overload, clipping or dropped samples are left out.
    """

    segment: float = 8.0
    overlap: float = 0.5
    window: str = "hann"
    excitations: tuple[str, ...] = ()
    responses: tuple[str, ...] = ()
    band: Band | None = None
    stream: str | None = None
    exclude: bool = False


def spectra_of_tests(recordings: Sequence[RecordingFile], settings: AveragingSettings) -> tuple[CrossSpectra, ...]:
    """Spectra of each recording on the lines that are kept.

    Parameters
    ----------
    recordings
        Recordings of one sample rate, one a test.
    settings
        How their spectra are computed.

    Raises
    ------
    InputError
        A file that cannot be used, or sample rates that differ.
    """
    spectra = tuple(spectra_of_test(recording, settings) for recording in recordings)
    check_equal_rates([path_of(recording).name for recording in recordings], [test.sample_rate for test in spectra])
    return spectra


def spectra_of_test(
    recording: RecordingFile, settings: AveragingSettings, segments: tuple[int, int] | None = None
) -> CrossSpectra:
    """Spectra of one recording, or of some of its segments, on the lines that are kept.

    Parameters
    ----------
    recording
        Forces and responses of one test.
    settings
        How its spectra are computed.
    segments
        First segment, and the one after the last; None: all.

    Raises
    ------
    InputError
        A file that cannot be used.
    """
    with opened(recording) as source:
        stream = source.stream(settings.stream)
        spectral = settings_for(stream.sample_rate, settings.segment, overlap=settings.overlap, window=settings.window)
        with progress(f"spectra of {source.path.name}", stream.n_samples) as update:
            spectra = cross_spectra(
                source,
                spectral,
                stream=settings.stream,
                excitations=settings.excitations or None,
                responses=settings.responses or None,
                exclude_unusable=settings.exclude,
                segments=segments,
                progress=update,
            )
    return spectra if settings.band is None else spectra_in_band(spectra, settings.band)


def check_equal_rates(names: Sequence[str], rates: Sequence[float]) -> None:
    """Refuse tests of different sample rates.

    Parameters
    ----------
    names, rates : Hz
        Name and sample rate of each test.

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


def spectra_in_band(spectra: CrossSpectra, band: Band) -> CrossSpectra:
    """The lines of spectra inside a band.

    Parameters
    ----------
    spectra
        Averaged spectra of all channels.
    band : Hz
        Lowest and highest frequency.

    Raises
    ------
    InputError
        No line lies inside.
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


def only_inputs(spectra: CrossSpectra, names: Sequence[str]) -> CrossSpectra:
    """The spectra with some of the excitations only.

    Parameters
    ----------
    spectra
        Averaged spectra of all channels.
    names
        Names of the excitations to keep.
    """
    kept = [number for number, channel in enumerate(spectra.excitations) if channel.name in names]
    return replace(
        spectra,
        input_spectra=spectra.input_spectra[:, kept][:, :, kept],
        cross_spectra=spectra.cross_spectra[:, :, kept],
        excitations=tuple(spectra.excitations[number] for number in kept),
    )
