"""`estimate` and `tap`: FRF matrices from recordings."""

from collections.abc import Sequence
from pathlib import Path

from millfrf.core import Band
from millfrf.core.progress import Progress, silent

from .estimate import estimate_recordings
from .given import File, GivenRecording, files_of, names_of, warn_of
from .tap import TapResult, tap_recordings
from .tap_points import TapOptions
from .test_spectra import Estimate, EstimateOptions


def estimate(
    *recordings: GivenRecording,
    segment: float = 8.0,
    overlap: float = 0.5,
    window: str = "hann",
    stack: str = "sum",
    excitations: str | Sequence[str] = (),
    responses: str | Sequence[str] = (),
    band: Band | None = None,
    stream: str | None = None,
    estimator: str = "h1",
    exclude: bool = False,
    instruments: str | Sequence[str] = (),
    progress: Progress = silent,
) -> Estimate:
    """FRF matrix over one or many tests of one set-up, with coherence and covariance: ``X = H F``.

    Parameters
    ----------
    recordings
        Recordings or the names of their files, one a test.
    segment
        Duration of a segment, s.
    overlap
        Share of a segment that the next one shares, 0 to below 1.
    window
        One of ``hann``, ``hamming`` and ``boxcar``.
    stack
        How tests are stacked: ``sum`` or ``side-by-side``.
    excitations, responses
        Names of channels; empty: forces and voltages excite, motions respond.
    band
        Lowest and highest frequency to keep, Hz; None: all lines.
    stream
        Name of the sample clock; None: the only one.
    estimator
        One of ``h1``, ``h2``, ``hv``, ``instrumental-variable`` and ``local-polynomial``.
    exclude
        Leave out segments with overload, clipping or dropped samples.
    instruments
        Names of channels that drive the forces and that no disturbance reaches, for ``instrumental-variable``.
    progress
        Shows progress, such as ``millfrf.progress.bar``.

    Returns
    -------
    Estimate
        The FRF, the spectra of each test and the doubts, which are warned of as well.

    Raises
    ------
    InputError
        A recording or an option that cannot be used, or inputs that are dependent wherever they have power.
    """
    options = EstimateOptions(
        segment,
        overlap,
        window,
        stack,
        names_of(excitations),
        names_of(responses),
        band,
        stream,
        estimator,
        exclude,
        names_of(instruments),
    )
    found = estimate_recordings(files_of(recordings), options, progress)
    warn_of(found.warnings)
    return found


def tap(
    *recordings: GivenRecording,
    point: str = "",
    points: File | None = None,
    segment: float | None = None,
    pre_trigger: float | None = None,
    force_window: str = "auto",
    exponential: str = "auto",
    excitations: str | Sequence[str] = (),
    responses: str | Sequence[str] = (),
    band: Band | None = None,
    stream: str | None = None,
    progress: Progress = silent,
) -> TapResult:
    """FRF matrix of hammer tests, roving hammer or roving sensor, with the coherence of each entry.

    Parameters
    ----------
    recordings
        Recordings or the names of their files.
    point
        Point hit in all recordings, ``node:direction``; empty: as the files say.
    points
        File of a table (CSV or TOML) that says which point was hit in which file; None: as the files say.
    segment
        Duration of a segment, s; None: the time between the taps.
    pre_trigger
        Time before the peak of a tap, s; None: twice the longest contact.
    force_window
        ``auto``, ``none``, or the time after the peak at which the force is cut off, s, as text.
    exponential
        ``auto`` (where answers have not died out), ``none``, or the time constant, s, as text.
    excitations, responses
        Names of channels; empty: chosen by quantity.
    band
        Lowest and highest frequency to keep, Hz; None: all lines that are driven.
    stream
        Name of the sample clock; None: the only one.
    progress
        Shows progress, such as ``millfrf.progress.bar``.

    Returns
    -------
    TapResult
        The FRF, the taps with the reason why one was left out, and the doubts, which are warned of as well.

    Raises
    ------
    InputError
        A recording or an option that cannot be used, or entries of the matrix that no tap gives.
    """
    table = None if points is None else Path(points)
    channels = (names_of(excitations), names_of(responses))
    options = TapOptions(segment, pre_trigger, force_window, exponential, point, table, *channels, band, stream)
    found = tap_recordings(files_of(recordings), options, progress)
    warn_of(found.warnings)
    return found
