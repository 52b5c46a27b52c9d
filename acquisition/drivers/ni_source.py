"""National Instruments modules through DAQmx: all inputs in one task, continuously."""

import contextlib
import time
from collections import deque
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError

from ..channels import Channel
from ..errors import DeviceError, DeviceTimeout, Overrun
from ..sources.feeds import CLEARED, DEVICES, DEVICES_AXIS, FAULT, device_event
from ..sources.source import Block, EventAxis, Events, StreamDescription
from .ni_channels import CounterReading, NiCounter, NiInput, input_delay, mismatches
from .ni_devices import identity, speaking_to

_QUESTIONS = {
    "overloaded_chans": "overload",
    "open_current_loop_chans": "open current loop",
    "open_chans": "open circuit",
    "excit_fault_chans": "excitation fault",
    "sync_unlocked_chans": "not synchronized",
    "pll_unlocked_chans": "clock not locked",
}
"""Properties of a task's input stream by what they say of a channel; each is asked as ``..._exist`` first."""


class NiStatus:
    """Asks a running task for the status of its channels and tells changes.

    Parameters
    ----------
    task
        The running task; questions that its modules do not know are not asked again.
    """

    def __init__(self, task: Any) -> None:
        self._stream = task.in_stream
        self._questions = dict(_QUESTIONS)
        self._standing: set[str] = set()

    def changes(self, begun: float) -> list[Events]:
        """Faults that came and went with the last block, whose first sample had the host's time ``begun`` (s)."""
        now = self._faults()
        came = [device_event(begun, FAULT, f"channel {fault}") for fault in sorted(now - self._standing)]
        went = [device_event(begun, CLEARED, f"channel {fault}") for fault in sorted(self._standing - now)]
        self._standing = now
        return [*went, *came]

    def _faults(self) -> set[str]:
        """Each channel with each of its faults since the last question."""
        from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError

        found: set[str] = set()
        for question, words in list(self._questions.items()):
            try:
                if getattr(self._stream, f"{question}_exist"):
                    found |= {f"{name}: {words}" for name in getattr(self._stream, question)}
            except (DaqError, DaqFunctionNotSupportedError):
                del self._questions[question]
        return found


@dataclass(frozen=True)
class NiClocks:
    """Where a task takes its clocks and its start from; empty: DAQmx chooses, which is right within one chassis.

    Parameters
    ----------
    sample_clock
        Terminal of an external sample clock, such as ``/cDAQ1/PFI0``.
    reference_clock
        Terminal of a reference clock that several chassis share, such as ``/PXI1Slot2/PXI_Clk10``.
    reference_rate : Hz
        Rate of that reference clock; None: DAQmx knows it.
    sync_pulse
        Terminal of the pulse that aligns the converters of several devices (delta-sigma modules).
    start_trigger
        Terminal whose edge starts the samples; empty: they start at once.
    start_edge
        Edge that counts.
    trigger_timeout : s
        Time to wait for that edge.
    """

    sample_clock: str = ""
    reference_clock: str = ""
    reference_rate: float | None = None
    sync_pulse: str = ""
    start_trigger: str = ""
    start_edge: Literal["rising", "falling"] = "rising"
    trigger_timeout: float = 600.0

    def apply(self, task: Any, rate: float) -> None:
        """Set up timing and trigger of a task that has its channels; ``rate`` in Hz is the wanted one."""
        from nidaqmx import constants

        task.timing.cfg_samp_clk_timing(
            rate, source=self.sample_clock, sample_mode=constants.AcquisitionType.CONTINUOUS
        )
        if self.reference_clock:
            task.timing.ref_clk_src = self.reference_clock
            if self.reference_rate is not None:
                task.timing.ref_clk_rate = self.reference_rate
        if self.sync_pulse:
            task.timing.sync_pulse_src = self.sync_pulse
        if self.start_trigger:
            edge = constants.Edge.RISING if self.start_edge == "rising" else constants.Edge.FALLING
            task.triggers.start_trigger.cfg_dig_edge_start_trig(self.start_trigger, trigger_edge=edge)

    def check(self, task: Any, devices: str) -> None:
        """Read back where the clocks come from.

        Raises
        ------
        InputError
            DAQmx took another terminal than the one asked for.
        """
        for what, wanted, attribute in (
            ("sample clock", self.sample_clock, "samp_clk_src"),
            ("reference clock", self.reference_clock, "ref_clk_src"),
            ("sync pulse", self.sync_pulse, "sync_pulse_src"),
        ):
            found = str(getattr(task.timing, attribute)) if wanted else ""
            if found.strip("/").lower() != wanted.strip("/").lower():
                raise InputError(f"{devices}: {what} is {found!r}, not {wanted!r} as asked; correct it in the session")


NI_9234_TIMEBASE = 13.1072e6
"""Hz; an NI-9234 samples at this / 256 / n, n = 1 ... 31."""


def ni_9234_rate(wanted: float) -> float:
    """The NI-9234's rate nearest above ``wanted`` (Hz), or its largest.

    Examples
    --------
    >>> ni_9234_rate(20000.0), ni_9234_rate(1e6)
    (25600.0, 51200.0)
    """
    highest = NI_9234_TIMEBASE / 256
    return highest / min(max(int(highest / wanted + 1e-9), 1), 31)


class NiSource:
    """Inputs of one or several modules on one sample clock, read without a gap.

    The task is set up once when the source is made, so that the achieved rate, the modules' input delays and all
    settings are known before recording: what differs from what was asked is an error then, or one of `notices`. `open`
    sets the task up again and starts it. While it runs, overloads and open loops that the modules notice are told in
    the series `devices`.

    Parameters
    ----------
    inputs
        Inputs, each with the sensor that is wired to it.
    sample_rate : Hz
        Wanted sample rate; `streams` says what the device made of it.
    counters
        Counters that are read at each sample, after the inputs.
    clocks
        Clocks and trigger; None: as DAQmx chooses, started at once.
    block_duration : s
        Duration of a block.
    buffer_duration : s
        Duration of the samples that the driver holds while this computer is busy.
    timeout : s
        Time to wait for a block beyond its own duration.
    duration : s
        Time to record; None: until stopped.
    name, title, setup
        Name of the stream, title and set-up of the recording.

    Raises
    ------
    DriverMissing, Disconnected, DeviceError, InputError
        The device cannot be set up, or not as asked.
    """

    def __init__(
        self,
        inputs: Sequence[NiInput],
        sample_rate: float,
        *,
        counters: Sequence[NiCounter] = (),
        clocks: NiClocks | None = None,
        block_duration: float = 0.1,
        buffer_duration: float = 10.0,
        timeout: float = 5.0,
        duration: float | None = None,
        name: str = "ni",
        title: str = "",
        setup: str = "",
    ) -> None:
        if not inputs:
            raise InputError("an NI source needs at least one input; add a table [[channels]] to the session")
        self.title, self.setup = title, setup
        self._inputs, self._counters = tuple(inputs), tuple(counters)
        self._clocks = clocks or NiClocks()
        self._wished_rate = sample_rate
        self._timeout = timeout
        self._buffer_duration = buffer_duration
        self._names = tuple(dict.fromkeys([*(each.device for each in inputs), *(each.device for each in counters)]))
        self._devices = " ".join(self._names)
        self._scales = np.array([each.scale for each in inputs])
        self._task: Any = None
        self._reader: Any = None
        self._status: NiStatus | None = None
        self._counting: list[CounterReading] = []
        self._opened = ExitStack()
        self._pending: deque[Events] = deque()
        self._taken = 0
        self.event_series: dict[str, EventAxis] = {DEVICES: DEVICES_AXIS}
        self.notices: tuple[str, ...] = ()
        with ExitStack() as stack:
            task, created = self._configured(stack)
            with speaking_to(self._devices):
                rate = float(task.timing.samp_clk_rate)
                channels = self._described(task, created)
        self._judge_rate(rate)
        self.streams: tuple[StreamDescription, ...] = (StreamDescription(name, rate, 0.0, channels),)
        self._block_length = max(1, round(block_duration * rate))
        self.n_samples: int | None = None if duration is None else round(duration * rate)

    @property
    def sample_rate(self) -> float:
        """The achieved rate, Hz."""
        return self.streams[0].sample_rate

    def _configured(self, stack: ExitStack) -> tuple[Any, list[Any]]:
        """A task ready to start, and its channels as DAQmx calls them; the stack closes it."""
        with speaking_to(self._devices):
            import nidaqmx

            task = nidaqmx.Task()
            stack.callback(self._closed, task)
            created = [each.add_to(task.ai_channels) for each in self._inputs]
            self._clocks.apply(task, self._wished_rate)
            task.in_stream.input_buf_size = int(self._buffer_duration * task.timing.samp_clk_rate)
        return task, created

    def _closed(self, task: Any) -> None:
        """Clear a task, whatever state its device is in."""
        with contextlib.suppress(DeviceError, InputError), speaking_to(self._devices):
            task.close()

    def _described(self, task: Any, created: Sequence[Any]) -> tuple[Channel, ...]:
        """The channels with what the driver tells of them.

        Raises
        ------
        InputError
            It was not set as asked.
        """
        self._clocks.check(task, self._devices)
        devices = {name: identity(name) for name in self._names}
        channels, said = [], []
        for each, channel in zip(self._inputs, created, strict=True):
            found = each.read_back(channel)
            said += mismatches(each, found)
            delay, sensor = input_delay(channel), each.sensor_identity()
            channels.append(each.described(delay, found, devices[each.device], sensor))
            reach = found.range_volts or each.range_volts
            if reach > 1.001 * each.range_volts:
                self.notices += (f"channel {each.channel.name}: range {each.range_volts:g} V asked, {reach:g} V made",)
        if said:
            raise InputError(f"{'; '.join(said)}; correct the session or the wiring")
        return (*channels, *(each.described(devices[each.device]) for each in self._counters))

    def _judge_rate(self, rate: float) -> None:
        """Refuse a lower rate than asked; tell a higher one."""
        if rate < (1 - 1e-4) * self._wished_rate:
            raise InputError(
                f"{self._devices}: sample_rate_hz {self._wished_rate:g} is above what the device makes, {rate:.9g} Hz; "
                "ask for that or less"
            )
        if rate > (1 + 1e-4) * self._wished_rate:
            self.notices += (f"sample rate {self._wished_rate:g} Hz asked, {rate:.9g} Hz made",)

    def open(self) -> None:
        """Start the task; with a trigger the samples begin at its edge.

        Raises
        ------
        DeviceError
            As on making the source.
        """
        self.close()
        with ExitStack() as stack:
            self._task, _ = self._configured(stack)
            with speaking_to(self._devices):
                from nidaqmx.stream_readers import AnalogMultiChannelReader

                self._reader = AnalogMultiChannelReader(self._task.in_stream)
                self._reader.verify_array_shape = False
                self._start_counters(stack)
                self._status = NiStatus(self._task)
                self._taken = 0
                self._pending.clear()
                self._task.start()
            self._armed = time.monotonic()
            self._opened = stack.pop_all()

    def _start_counters(self, stack: ExitStack) -> None:
        """Counters wait for the inputs' sample clock: they are started first, and miss none of its ticks."""
        self._counting = []
        source = str(self._task.timing.samp_clk_term) if self._counters else ""
        for counter in self._counters:
            task = counter.task(self.sample_rate, source, int(self._buffer_duration * self.sample_rate))
            stack.callback(self._closed, task)
            task.start()
            self._counting.append(CounterReading(task))

    def read(self) -> Block | Events | None:
        """The next block, waited for, or what the modules noticed; None when the duration is over.

        Raises
        ------
        Overrun
            With the number of samples a channel that are missing.
        DeviceTimeout, Disconnected, DeviceError
            The device stopped giving samples.
        """
        if self._task is None:
            return None
        if self._pending:
            return self._pending.popleft()
        left = self._block_length if self.n_samples is None else self.n_samples - self._taken
        length = min(self._block_length, left)
        if length <= 0:
            return None
        if self._clocks.start_trigger and self._taken == 0 and not self._triggered():
            return Events(DEVICES, np.empty(0), np.empty(0), None, ())  # nothing yet: whoever stops is heard
        return self._next_block(length)

    def _triggered(self) -> bool:
        """Whether samples came; waits for a moment.

        Raises
        ------
        DeviceTimeout
            The trigger did not come in time.
        """
        with speaking_to(self._devices):
            if int(self._task.in_stream.total_samp_per_chan_acquired):
                return True
        waited = time.monotonic() - self._armed
        if waited > self._clocks.trigger_timeout:
            raise DeviceTimeout(
                f"{self._devices}: no edge at the start trigger {self._clocks.start_trigger} for {waited:.3g} s; check "
                "its wire and start_edge"
            )
        time.sleep(0.05)
        return False

    def _next_block(self, length: int) -> Block:
        raw = np.empty((len(self._inputs), length))
        wait = self._timeout + length / self.sample_rate
        try:
            with speaking_to(self._devices):
                self._reader.read_many_sample(raw, length, wait)
                counted = [counter.read(length, wait) for counter in self._counting]
        except Overrun as error:
            raise self._counted(error) from error
        first, self._taken = self._taken, self._taken + length
        return self._block(first, raw, counted)

    def _block(self, first: int, raw: NDArray[np.float64], counted: Sequence[NDArray[np.float64]]) -> Block:
        """The block with a pair of sample count and host time, both taken now."""
        with speaking_to(self._devices):
            count = int(self._task.in_stream.total_samp_per_chan_acquired)
            noticed = time.monotonic()  # after asking: a pair may be late, never early
            if self._status is not None:
                ended = noticed - (count - self._taken) / self.sample_rate
                begun = ended - raw.shape[1] / self.sample_rate
                self._pending.extend(self._status.changes(begun))
        samples = np.ascontiguousarray(raw.T) * self._scales
        if counted:
            samples = np.column_stack([samples, *counted])
        return Block(self.streams[0].name, first, samples, noticed, count)

    def _counted(self, error: Overrun) -> Overrun:
        """The overrun with the number of samples that the driver had to drop, where it still tells."""
        missing = None
        with contextlib.suppress(DeviceError), speaking_to(self._devices):
            acquired = int(self._task.in_stream.total_samp_per_chan_acquired)
            missing = max(acquired - int(self._task.in_stream.input_buf_size) - self._taken, 1)
        if missing is None:
            return error
        return Overrun(f"{error}; {missing} samples a channel are missing after sample {self._taken}", missing)

    def close(self) -> None:
        """Stop and clear the tasks; harmless when not open."""
        self._task, self._reader, self._status, self._counting = None, None, None, []
        self._opened.close()
