"""Alignment in time: fits and checks of clocks, compensation of channel delays, events on the samples' axis."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from millfrf.core import FileFormatError, Index, InputError, Real

from ..settings import SETTINGS
from ..sources.source import StreamDescription
from .stream import Stream
from .tables import EventSeries


@dataclass(frozen=True)
class ClockFit:
    """Straight line ``host = origin_host + slope * (local - origin_local)`` of a device's clock.

    ``local`` is a sample count or a time of the device, ``host`` the host's monotonic time (s). ``drift`` is the
    relative error of the slope against its nominal value, positive for a slow device.
    """

    origin_local: float
    origin_host: float
    slope: float
    drift: float

    def host(self, local: Real | float) -> Real:
        """Convert a reading of the device to the host's monotonic time, s."""
        return self.origin_host + self.slope * (np.asarray(local, dtype=float) - self.origin_local)

    def local(self, host: Real | float) -> Real:
        """Convert the host's monotonic time (s) to a reading of the device."""
        return self.origin_local + (np.asarray(host, dtype=float) - self.origin_host) / self.slope


def fit_clock(local: Real, host: Real, nominal_slope: float) -> ClockFit:
    """Fit offset and drift of a device's clock, robust against stalls of the host.

    ``local`` and ``host`` hold a reading of the device and the host's time (s) at which it was noticed;
    ``nominal_slope`` is the host's seconds per unit of ``local``: 1 / sample rate, or 1.
    """
    local, host = np.asarray(local, dtype=float), np.asarray(host, dtype=float)
    if local.shape != host.shape or local.ndim != 1 or not len(local):
        raise InputError(f"{local.size} readings and {host.size} host times make no clock; record at least one pair")
    if not (np.isfinite(local).all() and np.isfinite(host).all()):
        raise InputError("a clock's pairs hold NaN or infinity; leave those out")
    x0, t0 = float(local[0]), float(host[0])
    elapsed = (local - x0) * nominal_slope
    late = host - t0 - elapsed
    # A pair can be late but never early, so the least late pair of each window is closest to the clock.
    order = np.argsort(elapsed, kind="stable")
    best = _least_late(late, order, int(np.clip(len(order) // 5, 1, 60)))
    drift = _median_slope(elapsed[best], late[best])
    low, middle = np.quantile(late[best] - drift * elapsed[best], (0.25, 0.5))
    span = float(np.ptp(elapsed[best]))
    # A short record cannot determine a drift: the slope is shrunk towards zero by its error against the prior.
    prior = SETTINGS.expected_drift
    error = (float(middle - low) + SETTINGS.host_time_error) / span if span > 0 else np.inf
    drift = 0.0 if np.isinf(error) else drift * (prior**2 / (prior**2 + error**2))
    offset = float(np.quantile(late[best] - drift * elapsed[best], 0.25))
    return ClockFit(x0, t0 + offset, nominal_slope * (1 + drift), drift)


def _least_late(late: Real, order: Index, n_windows: int) -> Index:
    """Return the index of the least late pair in each window of equal numbers of pairs.

    ``order`` sorts the pairs in time.
    """
    return np.array([window[np.argmin(late[window])] for window in np.array_split(order, n_windows)])


def _median_slope(x: Real, y: Real) -> float:
    """Return the Theil-Sen slope from pairs of points at least a quarter of the range apart; 0 if there is none."""
    first, second = np.triu_indices(len(x), 1)
    run = x[second] - x[first]
    usable = run > 0.25 * np.ptp(x) if len(x) > 1 else np.zeros(0, dtype=bool)
    return float(np.median((y[second] - y[first])[usable] / run[usable])) if usable.any() else 0.0


@dataclass(frozen=True)
class Gap:
    """Missing time of ``seconds`` (s) between two samples, after the first ``after_sample`` samples."""

    after_sample: int
    seconds: float


@dataclass(frozen=True)
class ClockFindings:
    """Sample rate and missing time of a stream according to the host's clock.

    Parameters
    ----------
    stated_rate, true_rate : Hz
        Sample rate in the file, and sample rate by the host's clock, which is NaN if there are too few pairs.
    rate_error
        Relative standard error of the true rate.
    gaps
        Places at which time is missing.
    """

    stated_rate: float
    true_rate: float
    rate_error: float
    gaps: tuple[Gap, ...] = ()

    @property
    def rate_is_wrong(self) -> bool:
        """Return whether the stated rate is off by more than clocks are, and by more than chance explains."""
        deviation = abs(self.true_rate / self.stated_rate - 1)
        return bool(deviation > SETTINGS.largest_rate_error + 5 * self.rate_error)


def check_clock(pairs: Real, stated_rate: float) -> ClockFindings:
    """Compare the sample rate of a stream with the host's clock, and find missing time.

    Parameters
    ----------
    pairs : (n_pairs, 2)
        Sample count, and the host's monotonic time (s) at which these samples were available.
    stated_rate : Hz
        Sample rate in the file.

    Returns
    -------
    ClockFindings
        The true rate is NaN where the pairs do not determine it.

    Examples
    --------
    >>> counts = np.arange(1, 101) * 1024.0
    >>> findings = check_clock(np.column_stack([counts, counts / 9216]), 10240.0)
    >>> round(findings.true_rate), findings.rate_is_wrong, findings.gaps
    (9216, True, ())
    """
    pairs = pairs[np.isfinite(pairs).all(axis=1)]
    pairs = pairs[np.argsort(pairs[:, 0], kind="stable")]
    unknown = ClockFindings(stated_rate, float("nan"), float("inf"))
    if len(pairs) < SETTINGS.fewest_clock_pairs or np.ptp(pairs[:, 0]) <= 0:
        return unknown
    period, error = _period(pairs)
    if not period > 0:
        return unknown
    gaps = _find_gaps(pairs, period)
    if gaps:
        # A slope across a gap contains no information on the rate: close the gaps and estimate the rate again.
        closed = pairs.copy()
        for gap in gaps:
            closed[pairs[:, 0] > gap.after_sample, 1] -= gap.seconds
        period, error = _period(closed)
    return ClockFindings(stated_rate, 1.0 / period, error, gaps)


def _period(pairs: Real) -> tuple[float, float]:
    """Return the host's seconds per sample, and its relative standard error; NaN if the pairs do not determine it.

    It is the median slope between the least late pairs of neighbouring windows: a gap changes one slope, not the
    median.
    """
    unknown = float("nan"), float("inf")
    rough = float(np.median(np.diff(pairs[:, 1])) / np.median(np.diff(pairs[:, 0])))
    chosen = pairs[_least_late_by_count(pairs[:, 1] - rough * pairs[:, 0])]
    run, rise = np.diff(chosen[:, 0]), np.diff(chosen[:, 1])
    slopes = rise[run > 0] / run[run > 0]
    period = float(np.median(slopes)) if len(slopes) else float("nan")
    if not period > 0:
        return unknown
    # 1.4826 turns a median absolute deviation into a standard deviation; 1.2533 = sqrt(pi / 2) is for a median.
    spread = 1.4826 * float(np.median(np.abs(slopes - period)))
    spread += SETTINGS.host_time_error / float(np.median(run[run > 0]))
    error = 1.2533 * spread / np.sqrt(len(slopes)) / period
    if len(slopes) >= SETTINGS.fewest_clock_slopes:
        return period, error
    # The spread of few slopes is uncertain: the usual lateness over the whole recording bounds the error.
    late = pairs[:, 1] - period * pairs[:, 0]
    usual = float(np.quantile(late, 0.9) - late.min())
    return period, error + usual / (period * float(np.ptp(pairs[:, 0])))


def _least_late_by_count(late: Real) -> Index:
    return _least_late(late, np.arange(len(late)), int(np.clip(len(late) // 8, 2, 30)))


def _find_gaps(pairs: Real, period: float) -> tuple[Gap, ...]:
    """Find the places after which the lateness never falls back to its former level.

    Several pairs must keep the new level, because a stalled host catches up.
    """
    late = pairs[:, 1] - period * pairs[:, 0]
    best = late[_least_late_by_count(late)]
    scatter = float(np.median(np.abs(np.diff(best))))
    threshold = max(SETTINGS.smallest_gap, SETTINGS.gap_over_scatter * scatter)
    lowest_after = np.minimum.accumulate(late[::-1])[::-1]
    rises = np.diff(lowest_after)
    gaps = []
    for k in np.flatnonzero(rises > threshold):
        # A stalled host catches up. Several of the next pairs must therefore stay at the new level.
        following = late[k + 1 : k + 1 + SETTINGS.pairs_after_gap]
        if np.sum(following < lowest_after[k + 1] + threshold) >= SETTINGS.fewest_clock_pairs:
            gaps.append(Gap(int(pairs[k, 0]), float(rises[k])))
    return tuple(gaps)


class Aligner:
    """Compensates the delays of channels, block by block, by interpolation with a windowed sinc.

    ``delays`` (s) holds the delay of each channel; only differences matter and none may be negative. The first row that
    `add` returns is ``skipped`` rows after the first row it received.

    Examples
    --------
    >>> rows = np.arange(200.0)
    >>> late = np.sin(0.5 * (rows[:, None] - [0.0, 2.25]))
    >>> aligned = Aligner([0.0, 2.25e-3], 1000.0).add(late)
    >>> bool(np.abs(aligned[:, 1] - aligned[:, 0]).max() < 2e-4)
    True
    """

    def __init__(self, delays: Sequence[float], sample_rate: float) -> None:
        rows = np.asarray(delays, dtype=float) * sample_rate
        self._shifts = np.round(rows).astype(int)
        fractions = rows - self._shifts
        tolerance = SETTINGS.whole_row_tolerance
        self._kernels = [_sinc_kernel(f) if abs(f) > tolerance else None for f in fractions]
        interpolates = any(kernel is not None for kernel in self._kernels)
        self.skipped = SETTINGS.interpolation_half_width if interpolates else 0
        self._buffer: Real | None = None

    @property
    def is_trivial(self) -> bool:
        """Return whether all delays are equal, so that samples pass unchanged."""
        return self.skipped == 0 and not self._shifts.any()

    def add(self, samples: Real) -> Real:
        """Take the next rows (n, n_channels) and return the rows that are complete."""
        if self.is_trivial:
            return samples
        rows = samples if self._buffer is None else np.concatenate([self._buffer, samples])
        n_out = len(rows) - 2 * self.skipped - int(self._shifts.max())
        if n_out <= 0:
            self._buffer = rows
            return np.empty((0, rows.shape[1]))
        aligned = np.empty((n_out, rows.shape[1]))
        for column, (shift, kernel) in enumerate(zip(self._shifts, self._kernels, strict=True)):
            window = rows[shift : shift + n_out + 2 * self.skipped, column]
            aligned[:, column] = (
                window[self.skipped : self.skipped + n_out] if kernel is None else np.correlate(window, kernel, "valid")
            )
        self._buffer = rows[n_out:].copy()
        return aligned


def _sinc_kernel(fraction: float) -> Real:
    """Return a Kaiser-windowed sinc that interpolates ``fraction`` of a row after the middle row; its sum is 1."""
    half, beta = SETTINGS.interpolation_half_width, SETTINGS.interpolation_beta
    offsets = np.arange(-half, half + 1) - fraction
    argument = np.clip(1.0 - (offsets / (half + 1.0)) ** 2, 0.0, None)
    kernel = np.sinc(offsets) * np.i0(beta * np.sqrt(argument)) / np.i0(beta)
    return np.asarray(kernel / kernel.sum())


def _relative_delays(stream: StreamDescription, names: Sequence[str]) -> list[float]:
    """Return the delay of each named channel behind the least delayed channel of the stream, s."""
    delays = {channel.name: channel.input_delay_s or 0.0 for channel in stream.channels}
    return [delays[name] - stream.common_delay for name in names]


def rows_left_out(stream: Stream, names: Sequence[str]) -> int:
    """Count the rows at the beginning that :func:`aligned_blocks` omits.

    Parameters
    ----------
    stream
        Stream of an open recording.
    names
        Names of its channels.

    Returns
    -------
    int
        Number of rows; 0 if the delays of the named channels do not differ.
    """
    return Aligner(_relative_delays(stream.description, names), stream.sample_rate).skipped


def aligned_blocks(stream: Stream, names: Sequence[str], block_length: int = 1 << 16) -> Iterator[Real]:
    """Read named channels with their known input delays compensated, block by block.

    If delays differ, up to 31 rows at each end and the rows of the largest delay are omitted: no row depends on data
    outside the record. Otherwise all rows are read.

    Parameters
    ----------
    stream
        Stream of an open recording.
    names
        Names of its channels, in the order of the columns.
    block_length
        Largest number of rows that are read at once.

    Raises
    ------
    InputError
        An unknown channel name.
    """
    stream.columns(names)
    aligner = Aligner(_relative_delays(stream.description, names), stream.sample_rate)
    for block in stream.blocks(block_length, names):
        yield aligner.add(block)


def aligned_samples(stream: Stream, names: Sequence[str]) -> Real:
    """Read all rows of `aligned_blocks` at once, (n, n_channels)."""
    return np.concatenate([np.empty((0, len(names))), *aligned_blocks(stream, names)])


class Alignment:
    """Converts event times to the axis ``start_time + sample / sample_rate`` of one stream.

    An input that delays samples shows an event late; event times therefore agree with the least delayed channel.
    ``pairs`` (n_pairs, 2) are the stream's sample counts and host times (s). ``series`` are all series of the
    recording, because all series of the same device clock are fitted together.
    """

    def __init__(self, stream: StreamDescription, pairs: Real, series: Mapping[str, EventSeries]) -> None:
        self._stream = stream
        self._pairs = pairs
        self._series = series

    def read(self, name: str) -> tuple[Real, Real]:
        """Read times on the stream's axis (s) and values of a series, each (n_events,)."""
        series = self._series[name]
        times, values, _ = series.read_raw()
        axis = series.axis
        if axis.kind == "samples" or not len(times):
            return times, values
        host = self._device_clock(axis.clock).host(times) if axis.kind == "device" else times
        origin = self._stream.start_time + self._stream.common_delay
        return origin + self._stream_clock().local(host) / self._stream.sample_rate, values

    def _stream_clock(self) -> ClockFit:
        try:
            return fit_clock(self._pairs[:, 0], self._pairs[:, 1], 1.0 / self._stream.sample_rate)
        except InputError as error:
            raise FileFormatError(f"stream {self._stream.name} cannot be aligned: {error}") from error

    def _device_clock(self, clock: str) -> ClockFit:
        """Fit the clock of a device to the host's clock, by the arrival times of all series of that clock."""
        columns = [series.read_raw() for series in self._series.values() if series.axis.clock == clock]
        pairs = [(times, arrivals) for times, _, arrivals in columns if arrivals is not None]
        try:
            return fit_clock(np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs]), 1.0)
        except (InputError, ValueError) as error:
            raise FileFormatError(f"clock {clock} cannot be aligned: {error}") from error
