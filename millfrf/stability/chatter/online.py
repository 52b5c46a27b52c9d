"""Verdicts on a cut while it is recorded: the classification of a sliding window, and alarms."""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import Real

from ..settings import THRESHOLDS
from .classify import classify_cut
from .cutting_span import two_classes
from .evidence import Tracking
from .spindle import follow_spindle, track_spindle
from .verdict import CHATTER, HOPF, INCONCLUSIVE, STABLE, ChatterVerdict

IDLE = "idle"
ENTRY = "entry"  # the tool enters or leaves the cut
SWEEP = "sweep"  # the speed changes
UNDECIDED = "undecided"
_NEWEST = 8  # revolutions at the end of a window
_MARGIN = 10  # samples at both ends of a window that the filter before decimation falsifies


@dataclass(frozen=True)
class WindowVerdict:
    """Verdict on the window that ends at ``time``."""

    time: float  # s since the first sample
    kind: str  # that of a `ChatterVerdict`, ``idle``, ``entry`` or ``sweep``
    verdict: ChatterVerdict | None  # None: not judged


@dataclass(frozen=True)
class StateChange:
    """The state of the cut changed: chatter or an open verdict began, or ended, or chatter has now a frequency.

    ``state`` is ``hopf``, ``period-doubling``, ``undecided``, ``stable`` or ``idle``; ``verdict`` is None while the
    spindle idles.
    """

    time: float  # s since the first sample
    state: str
    verdict: ChatterVerdict | None


@dataclass(frozen=True)
class WatchedCut:
    """What is known about a cut before it begins.

    The fields are those of :func:`.classify.classify_cut`, except ``sample_rate`` (Hz), ``n_channels`` and
    ``spindle_speed`` (rad/s).
    """

    sample_rate: float
    n_channels: int
    spindle_speed: float
    teeth: int
    quantities: tuple[str, ...] = ()
    derivatives: tuple[int, ...] = ()
    natural_frequencies: tuple[float, ...] = ()
    runout: float = math.inf
    chip: float = math.nan
    tool: tuple[int, ...] = ()
    constant_force: bool = False


_WITHOUT_SAMPLES = ChatterVerdict(
    INCONCLUSIVE, math.nan, math.nan, math.nan, reason="samples are missing, or all equal: check the sensors"
)


class _StableCut:
    """Logarithms of the size of the motion that does not repeat, in the last windows of a stable cut."""

    def __init__(self) -> None:
        self._sizes: deque[float] = deque(maxlen=THRESHOLDS.online_stable)

    def append(self, size: float) -> None:
        self._sizes.append(size)

    def rise(self, size: float) -> float:
        """Return a size over the median of the stable cut; 1 where there is none yet."""
        if len(self._sizes) < THRESHOLDS.online_open:
            return 1.0
        return math.exp(size - float(np.median(self._sizes)))


class OnlineClassifier:
    """Classify a cut in windows that overlap, each of 0.4 s or 42 revolutions, whichever is longer.

    Every window is judged like a whole recording, by :func:`.classify.classify_cut`, below 5 kHz. The spindle is
    searched near its stated speed until its orders are above the noise, and then followed from window to window. Sizes
    of the orders so far are divided into two classes, as in recordings: windows of the smaller class are idle.
    Windows in which the stated speed changes by more than 1 % are not judged.
    Chatter is announced after two windows in a row, an open verdict after five, and the end of either after five.
    """

    def __init__(self, cut: WatchedCut) -> None:
        self.cut = cut
        self.state = IDLE
        self.stated_speed = cut.spindle_speed  # rad/s
        self._factor = max(1, int(cut.sample_rate / (2.5 * THRESHOLDS.online_highest)))
        self._rate = cut.sample_rate / self._factor
        self._buffer = np.zeros((0, cut.n_channels))
        self._end = 0  # number of samples so far
        self._next = 0  # sample at which the next window ends
        self._speed = cut.spindle_speed  # rad/s; that of the last window if the spindle is followed
        self._followed = False
        self._steady_since = 0  # sample; the stated speed was within the drift that is followed since then
        self._steady_speed = cut.spindle_speed  # rad/s; stated at that sample
        self._sizes: deque[float] = deque(maxlen=THRESHOLDS.online_memory)
        self._stable, self._newest = _StableCut(), _StableCut()
        self._idle_known = False  # whether sizes so far are of two classes
        self._recent: deque[WindowVerdict] = deque(maxlen=THRESHOLDS.online_open)
        self._located = False  # whether the frequency of the chatter is announced
        self._judged: list[WindowVerdict] = []

    @property
    def window(self) -> float:
        """Duration of a window, s."""
        turns = THRESHOLDS.least_revolutions + 2
        return max(THRESHOLDS.online_window, 2 * math.pi * turns / self._speed)

    @property
    def _hop(self) -> int:
        """Number of samples from window to window: 0.1 s, or an eighth of a window."""
        return round(max(THRESHOLDS.online_hop, self.window / 8) * self.cut.sample_rate)

    def set_speed(self, spindle_speed: float) -> None:
        """Take another stated spindle speed, rad/s, for the windows from now on."""
        self.stated_speed = spindle_speed
        if not abs(spindle_speed / self._steady_speed - 1) <= THRESHOLDS.speed_drift:
            self._steady_speed, self._steady_since = spindle_speed, self._end
        if not abs(spindle_speed / self._speed - 1) <= THRESHOLDS.speed_error:  # also where none was known
            self._speed, self._followed = spindle_speed, False

    def forget(self, first_sample: int) -> None:
        """Start a new window at ``first_sample``, after samples that were lost."""
        self._buffer = self._buffer[:0]
        self._end = first_sample

    def judged(self) -> list[WindowVerdict]:
        """Return the verdicts on the windows since the last call."""
        judged, self._judged = self._judged, []
        return judged

    def add(self, samples: Real) -> list[StateChange]:
        """Take samples (n_samples, n_channels) and return what changed in the windows that they complete."""
        self._buffer = np.concatenate([self._buffer, samples])
        self._end += len(samples)
        if math.isnan(self._speed):  # no speed is known yet
            self._buffer, self._next = self._buffer[:0], self._end
            return []
        changes = []
        while self._next <= self._end:
            stop, length = len(self._buffer) - (self._end - self._next), self._length
            if stop >= length:
                change = self._judge(self._buffer[stop - length : stop], self._next / self.cut.sample_rate)
                changes += [] if change is None else [change]
            self._next += self._hop
        self._buffer = self._buffer[-(self._length + self._hop) :]
        return changes

    @property
    def _length(self) -> int:
        return round(self.window * self.cut.sample_rate) + 2 * _MARGIN * self._factor

    def _judge(self, samples: Real, time: float) -> StateChange | None:
        """Judge one window."""
        steady = time * self.cut.sample_rate - len(samples) >= self._steady_since - 1
        window = self._window_verdict(samples, time) if steady else WindowVerdict(time, SWEEP, None)
        self._recent.append(window)
        self._judged.append(window)
        state = self._next_state()
        frequency = math.nan if window.verdict is None else window.verdict.frequency
        located = state in CHATTER and window.kind in CHATTER and math.isfinite(frequency)
        if state == self.state and (self._located or not located):
            return None
        self.state, self._located = state, located
        return StateChange(time, state, window.verdict)

    def _window_verdict(self, samples: Real, time: float) -> WindowVerdict:
        data = self._decimated(samples)
        if not np.isfinite(data).all() or not (data.std(axis=0) > 0).any():
            return WindowVerdict(time, INCONCLUSIVE, _WITHOUT_SAMPLES)
        size, idle_limit = _size(data), self._idle_limit()
        if size < idle_limit:
            self._sizes.append(size)
            return self._idle(time)
        verdict = self._classified(data)
        turns = self._turns(data)
        # chatter and noise are no part of the size of the orders, by which the idle spindle is distinguished
        of_orders = _size(turns.mean(axis=0))
        self._sizes.append(of_orders)
        if of_orders < idle_limit and verdict.kind not in CHATTER:
            return self._idle(time)
        unrepeated, share = _unrepeated(turns)
        # a pump or a fan that starts is no chatter
        tones = sum(tone.share**2 for tone in verdict.foreign)
        is_foreign = 2 * tones > share**2 and share < THRESHOLDS.unexplained
        if verdict.kind not in CHATTER and not is_foreign:
            newest = self._by_newest(verdict, turns[-_NEWEST:])
            if newest.kind in CHATTER:
                return WindowVerdict(time, newest.kind, newest)
            if share > THRESHOLDS.weak_chatter:
                verdict = self._against_stable(verdict, unrepeated, share)
        irregular = verdict.kind in CHATTER and share > THRESHOLDS.unexplained
        if _enters(turns) and not irregular:
            return WindowVerdict(time, ENTRY, verdict)
        if verdict.kind == STABLE:
            self._stable.append(unrepeated)
        return WindowVerdict(time, verdict.kind, verdict)

    def _idle(self, time: float) -> WindowVerdict:
        """Forget the last cut."""
        self._stable, self._newest = _StableCut(), _StableCut()
        return WindowVerdict(time, IDLE, None)

    def _against_stable(self, verdict: ChatterVerdict, unrepeated: float, share: float) -> ChatterVerdict:
        """Compare the motion that does not repeat (logarithm of its size) with that of the stable cut before.

        In a recording alone, irregular motion may be noise. The noise of a cut does not rise from one moment to the
        next, while the forced vibration stays as it is.
        """
        rise = self._stable.rise(unrepeated)
        if rise < THRESHOLDS.online_rise:
            return verdict
        reason = _risen(share, rise)
        if share < THRESHOLDS.modulated:
            return replace(verdict, kind=INCONCLUSIVE, reason=f"{reason}: weak chatter, or another material")
        return replace(verdict, kind=HOPF, reason=reason)

    def _by_newest(self, verdict: ChatterVerdict, turns: Real) -> ChatterVerdict:
        """Compare the newest revolutions of a window, in which chatter has grown most, with the stable cut before."""
        unrepeated, share = _changes(turns)
        rise = self._newest.rise(unrepeated)
        if verdict.kind == STABLE and rise < THRESHOLDS.online_rise:
            self._newest.append(unrepeated)
        chatters = rise > THRESHOLDS.online_rise and share > THRESHOLDS.modulated and not _enters(turns)
        return replace(verdict, kind=HOPF, reason=_risen(share, rise)) if chatters else verdict

    def _decimated(self, samples: Real) -> Real:
        if self._factor > 1:
            samples = np.asarray(scipy.signal.decimate(samples, self._factor, ftype="fir", axis=0))
        return samples[_MARGIN:-_MARGIN]

    def _turns(self, data: Real) -> Real:
        """Cut a window into revolutions, (n_revolutions, n_places, n_channels), to the nearest sample."""
        length = 2 * math.pi * self._rate / self._speed
        starts = np.round(np.arange(int(len(data) / length) - 1) * length).astype(int)
        return np.asarray(data[starts[:, None] + np.arange(int(length))])

    def _classified(self, data: Real) -> ChatterVerdict:
        """Follow the spindle; where the cut then seems to chatter at first, search its speed anew."""
        verdict = self._classify(data, follow_spindle) if self._followed else None
        if verdict is None or (verdict.kind != STABLE and self.state not in CHATTER):
            self._speed = self.stated_speed
            verdict = self._classify(data, track_spindle)
        self._followed = math.isfinite(verdict.spindle_speed)
        if self._followed:
            self._speed = verdict.spindle_speed
        return verdict

    def _classify(self, data: Real, tracking: Tracking) -> ChatterVerdict:
        cut = self.cut
        return classify_cut(
            data,
            self._rate,
            self._speed,
            cut.teeth,
            runout=cut.runout,
            derivatives=cut.derivatives,
            natural_frequencies=cut.natural_frequencies,
            chip=cut.chip,
            tool=cut.tool,
            quantities=cut.quantities,
            constant_force=cut.constant_force,
            tracking=tracking,
        )

    def _idle_limit(self) -> float:
        """Return the logarithm of the size below which the spindle idles; -inf where sizes are of one class."""
        if len(self._sizes) < 2:
            return -math.inf
        limit, ratio = two_classes(np.array(self._sizes))
        if ratio < math.log(THRESHOLDS.idle_ratio):
            return -math.inf
        if not self._idle_known:  # until now the idle spindle was judged like a cut
            self._idle_known, self._stable, self._newest = True, _StableCut(), _StableCut()
        return limit

    def _next_state(self) -> str:
        """Return the state after the latest window."""
        kinds = [window.kind for window in self._recent]
        last = kinds[-THRESHOLDS.online_confirmed :]
        if len(last) == THRESHOLDS.online_confirmed and all(kind in CHATTER for kind in last):
            return kinds[-1] if self.state not in CHATTER else self.state
        if len(kinds) < THRESHOLDS.online_open:
            return self.state
        if all(kind == INCONCLUSIVE for kind in kinds) and self.state != IDLE:
            return UNDECIDED
        if all(kind in (IDLE, SWEEP) for kind in kinds):
            return IDLE
        return STABLE if kinds[-1] == STABLE and not {*CHATTER, INCONCLUSIVE} & set(kinds) else self.state


def _size(samples: Real) -> float:
    """Return the logarithm of the geometric mean of the standard deviations of all channels that move."""
    sizes = samples.std(axis=0)
    return float(np.log(sizes[sizes > 0]).mean()) if (sizes > 0).any() else math.log(1e-300)


def _enters(turns: Real) -> bool:
    """Check whether the orders of the spindle grow or fall within a window, and all other motion with them.

    While a tool enters or leaves a cut, lines grow or fall with the orders; chatter grows beyond them.
    """
    of_orders, of_all = _growth(turns)
    beyond = math.log(THRESHOLDS.online_growth)
    return abs(of_orders) > beyond and of_all - max(of_orders, 0.0) < beyond / 2


def _growth(turns: Real) -> tuple[float, float]:
    """Return the logarithms of the growth of the orders and of all motion, from the first to the last fifth."""
    first, last = turns[: max(len(turns) // 5, 2)], turns[-max(len(turns) // 5, 2) :]
    of_orders = _size(last.mean(axis=0)) - _size(first.mean(axis=0))
    return of_orders, _size(last.reshape(-1, last.shape[2])) - _size(first.reshape(-1, first.shape[2]))


def _unrepeated(turns: Real) -> tuple[float, float]:
    """Return the logarithm of the size of what differs from turn to turn, and its share; medians of five parts."""
    parts = np.array_split(turns, 5)
    residuals = [(part - part.mean(axis=0)).reshape(-1, part.shape[2]) for part in parts]
    sizes = np.array([_size(residual) for residual in residuals])
    whole = np.array([_size(part.reshape(-1, part.shape[2])) for part in parts])
    return float(np.median(sizes)), float(np.exp(np.median(sizes - whole)))


def _changes(turns: Real) -> tuple[float, float]:
    """Return the logarithm of the size of the change from turn to turn, and its share of the motion."""
    change = (np.diff(turns, axis=0) / math.sqrt(2)).reshape(-1, turns.shape[2])
    size = _size(change)
    return size, math.exp(size - _size(turns.reshape(-1, turns.shape[2])))


def _risen(share: float, rise: float) -> str:
    part = f"{100 * share:.0f} % of the motion does not repeat"
    return f"{part}, {rise:.1f} times as much as in the stable cut before"
