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
from .stable_cut import StableCut, Unrepeated, change_of, enters, size_of, unrepeated_of
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

    The fields are those of :func:`classify_cut`, except ``sample_rate`` (Hz), ``n_channels`` and
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


class OnlineClassifier:
    """Classify a cut in windows that overlap, each of 0.4 s or 42 revolutions, whichever is longer.

    Every window is judged like a whole recording, by :func:`classify_cut`, below 5 kHz. The spindle is
    searched near its stated speed until its orders are above the noise, and then followed from window to window. Sizes
    of the orders so far are divided into two classes, as in recordings: windows of the smaller class are idle.
    Windows in which the stated speed changes by more than 1 % are not judged.
    Chatter is announced after three windows in a row, an open verdict after five, and the end of either after five;
    chatter from the first moment after four windows' length, which shows whether the stated speed is right.
    """

    def __init__(self, cut: WatchedCut) -> None:
        self.cut = cut
        self.state = UNDECIDED
        self.stated_speed = cut.spindle_speed  # rad/s
        self._factor = max(1, int(cut.sample_rate / (2.5 * THRESHOLDS.online_highest)))
        self._rate = cut.sample_rate / self._factor
        self._blocks: list[Real] = []  # newest samples, (n, n_channels) each
        self._end = 0  # number of samples so far
        self._next = 0  # sample at which the next window ends
        self._speed = cut.spindle_speed  # rad/s; that of the last window if the spindle is followed
        self._followed = False
        self._only_stated = True  # whether nothing measured the speed
        self._speed_holds = False  # whether a stable cut, or a longer part, has shown no doubt of the stated speed
        self._steady_since = 0  # sample; the stated speed was within the drift that is followed since then
        self._steady_speed = cut.spindle_speed  # rad/s; stated at that sample
        self._sizes: deque[float] = deque(maxlen=THRESHOLDS.online_memory)
        self._stable, self._newest = StableCut(), StableCut()
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
        """Take a measured spindle speed, rad/s, for the windows from now on."""
        self.stated_speed, self._only_stated = spindle_speed, False
        if not abs(spindle_speed / self._steady_speed - 1) <= THRESHOLDS.speed_drift:
            self._steady_speed, self._steady_since = spindle_speed, self._end
        if not abs(spindle_speed / self._speed - 1) <= THRESHOLDS.speed_error:  # also where none was known
            self._speed, self._followed, self._speed_holds = spindle_speed, False, False

    def forget(self, first_sample: int) -> None:
        """Start a new window at ``first_sample``, after samples that were lost."""
        self._blocks = []
        self._end = first_sample

    def judged(self) -> list[WindowVerdict]:
        """Return the verdicts on the windows since the last call."""
        judged, self._judged = self._judged, []
        return judged

    def add(self, samples: Real) -> list[StateChange]:
        """Take samples (n_samples, n_channels) and return what changed in the windows that they complete."""
        self._blocks.append(samples)
        self._end += len(samples)
        if math.isnan(self._speed):  # no speed is known yet
            self._blocks, self._next = [], self._end
        changes: list[StateChange] = []
        if self._next > self._end or not self._blocks:
            return changes
        newest = np.concatenate(self._blocks)
        while self._next <= self._end:
            stop, length = len(newest) - (self._end - self._next), self._length
            if stop >= length:
                change = self._judge(newest[:stop], self._next / self.cut.sample_rate)
                changes += [] if change is None else [change]
            self._next += self._hop
        kept = 1 if self._speed_holds else THRESHOLDS.online_longer
        self._blocks = [newest[-(kept * self._length + self._hop) :]]
        return changes

    @property
    def _length(self) -> int:
        return round(self.window * self.cut.sample_rate) + 2 * _MARGIN * self._factor

    def _judge(self, samples: Real, time: float) -> StateChange | None:
        """Judge the window at the end of the samples."""
        before, samples = samples, samples[-self._length :]
        steady = time * self.cut.sample_rate - len(samples) >= self._steady_since - 1
        window = self._window_verdict(samples, time) if steady else WindowVerdict(time, SWEEP, None)
        self._recent.append(window)
        self._judged.append(window)
        state = self._next_state()
        if state in CHATTER and not self._speed_holds:
            state = self._checked_at_length(before, state)
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
        size, idle_limit = size_of(data), self._idle_limit()
        if size < idle_limit:
            self._sizes.append(size)
            return self._idle(time)
        verdict = self._classified(data)
        turns = self._turns(data)
        # chatter and noise are no part of the size of the orders, by which the idle spindle is distinguished
        of_orders = size_of(turns.mean(axis=0))
        self._sizes.append(of_orders)
        if of_orders < idle_limit and verdict.kind not in CHATTER:
            return self._idle(time)
        unrepeated = unrepeated_of(turns)
        # a pump or a fan that starts is no chatter
        tones = sum(tone.share**2 for tone in verdict.foreign)
        is_foreign = 2 * tones > unrepeated.share**2 and unrepeated.share < THRESHOLDS.unexplained
        if verdict.kind not in CHATTER and not is_foreign:
            newest = self._by_newest(verdict, turns[-_NEWEST:])
            if newest.kind in CHATTER:
                return WindowVerdict(time, newest.kind, newest)
            if unrepeated.share > THRESHOLDS.weak_chatter:
                verdict = self._against_stable(verdict, unrepeated)
        irregular = verdict.kind in CHATTER and unrepeated.share > THRESHOLDS.unexplained
        if enters(turns) and not irregular:
            return WindowVerdict(time, ENTRY, verdict)
        if verdict.kind == STABLE:
            self._stable.append(unrepeated)
            self._speed_holds = True
        return WindowVerdict(time, verdict.kind, verdict)

    def _checked_at_length(self, samples: Real, state: str) -> str:
        """Return the state where a cut seems to chatter before it was stable: a wrong speed looks like that, too.

        A single window may not show that the stated tooth passing has no line; four together do.
        """
        if len(samples) < THRESHOLDS.online_longer * self._length:
            return self.state
        self._speed = self.stated_speed
        verdict = self._classify(self._decimated(samples), track_spindle, only_stated=self._only_stated)
        self._speed_holds = verdict.kind in CHATTER
        return state if self._speed_holds else UNDECIDED

    def _idle(self, time: float) -> WindowVerdict:
        """Forget the last cut."""
        self._stable, self._newest = StableCut(), StableCut()
        return WindowVerdict(time, IDLE, None)

    def _against_stable(self, verdict: ChatterVerdict, now: Unrepeated) -> ChatterVerdict:
        """Compare the motion that does not repeat with that of the stable cut before.

        In a recording alone, irregular motion may be noise. The noise of a cut does not rise that much while the forced
        vibration stays as it is.
        """
        rise = self._stable.rise(now)
        if rise < THRESHOLDS.online_rise:
            return verdict
        reason = self._stable.reason(now, rise)
        if now.share < THRESHOLDS.modulated:
            return replace(verdict, kind=INCONCLUSIVE, reason=f"{reason}: weak chatter, or another material")
        return replace(verdict, kind=HOPF, reason=reason)

    def _by_newest(self, verdict: ChatterVerdict, turns: Real) -> ChatterVerdict:
        """Compare the newest revolutions of a window, in which chatter has grown most, with the stable cut before."""
        now = change_of(turns)
        rise = self._newest.rise(now)
        if verdict.kind == STABLE and rise < THRESHOLDS.online_rise:
            self._newest.append(now)
        chatters = rise > THRESHOLDS.online_rise and now.share > THRESHOLDS.modulated and not enters(turns)
        return replace(verdict, kind=HOPF, reason=self._newest.reason(now, rise)) if chatters else verdict

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

    def _classify(self, data: Real, tracking: Tracking, *, only_stated: bool = False) -> ChatterVerdict:
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
            only_stated=only_stated,
        )

    def _idle_limit(self) -> float:
        """Return the logarithm of the size below which the spindle idles; -inf where sizes are of one class."""
        if len(self._sizes) < 2:
            return -math.inf
        limit, ratio = two_classes(np.array(self._sizes))
        if ratio < math.log(THRESHOLDS.idle_ratio):
            return -math.inf
        if not self._idle_known:  # until now the idle spindle was judged like a cut
            self._idle_known, self._stable, self._newest = True, StableCut(), StableCut()
        return limit

    def _next_state(self) -> str:
        """Return the state after the latest window."""
        kinds = [window.kind for window in self._recent]
        last = kinds[-THRESHOLDS.online_confirmed :]
        if len(last) == THRESHOLDS.online_confirmed and all(kind in CHATTER for kind in last):
            return kinds[-1] if self.state not in CHATTER else self.state
        if len(kinds) < THRESHOLDS.online_open:
            return self.state
        if all(kind == INCONCLUSIVE for kind in kinds):
            return UNDECIDED
        if all(kind in (IDLE, SWEEP) for kind in kinds):
            return IDLE
        return STABLE if kinds[-1] == STABLE and not {*CHATTER, INCONCLUSIVE} & set(kinds) else self.state
