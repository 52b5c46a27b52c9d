"""National Instruments modules through DAQmx: all inputs in one task, read continuously."""

import time
from collections import deque
from collections.abc import Sequence
from contextlib import ExitStack, suppress
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field

from millfrf.core import InputError, Real

from ..channels import STRICT, Channel, Positive
from ..settings import SETTINGS
from ..sources.feeds import CLEARED, DEVICES, DEVICES_AXIS, FAULT, device_event
from ..sources.source import Block, DeviceError, DeviceTimeout, EventAxis, Events, Overrun, StreamDescription
from .ni_channels import ChannelTable, CounterReader, CounterTable
from .ni_devices import identity, input_delay, sensor_identity, translating_errors

# fault of a channel by the property of a task's input stream that reports it; `..._exist` is read first
_FAULTS = {
    "overloaded_chans": "overload",
    "open_current_loop_chans": "open current loop",
    "open_chans": "open circuit",
    "excit_fault_chans": "excitation fault",
    "sync_unlocked_chans": "not synchronized",
    "pll_unlocked_chans": "clock not locked",
}


class NiStatus:
    """Reads the faults of the channels of a running task and reports changes."""

    def __init__(self, task: Any) -> None:
        self._stream = task.in_stream
        self._properties = dict(_FAULTS)
        self._present: set[str] = set()

    def changes(self, block_start: float) -> list[Events]:
        """Return the faults that came or went with the last block, which started at this host's time, s."""
        now = self._faults()
        new = [device_event(block_start, FAULT, f"channel {fault}") for fault in sorted(now - self._present)]
        over = [device_event(block_start, CLEARED, f"channel {fault}") for fault in sorted(self._present - now)]
        self._present = now
        return [*over, *new]

    def _faults(self) -> set[str]:
        """Return the faults of all channels since the last call, each as ``channel: fault``."""
        from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError  # optional: the extra `devices`

        faults: set[str] = set()
        for name, fault in list(self._properties.items()):
            try:
                if getattr(self._stream, f"{name}_exist"):
                    faults |= {f"{channel}: {fault}" for channel in getattr(self._stream, name)}
            except (DaqError, DaqFunctionNotSupportedError):
                del self._properties[name]  # the modules do not have it
        return faults


class NiDevice(BaseModel):
    """`[device]` with ``driver = "ni"``. Empty terminals of clocks: DAQmx chooses, which is right within one chassis.

    Parameters
    ----------
    driver
        ``ni``: a device of National Instruments through DAQmx.
    sample_rate_hz : Hz
        Samples per second of every channel; at least 2.56 times the upper end of ``band_hz``.
    block_s : s
        Duration of a block that is read and written at once.
    buffer_s : s
        Duration of the samples that the driver's buffer holds while the disk is slow.
    timeout_s : s
        Time without samples after which the device counts as lost.
    sample_clock
        Terminal of an external sample clock, such as ``/cDAQ1/PFI0``; empty: the device's own.
    reference_clock
        Terminal of a reference clock that several chassis share, such as ``/PXI1Slot2/PXI_Clk10``.
    reference_clock_hz : Hz
        Rate of that clock; left out: DAQmx knows it.
    sync_pulse
        Terminal of the pulse that aligns the converters of several devices.
    start_trigger
        Terminal whose edge starts the samples; empty: they start at once.
    start_edge
        Edge of the trigger, ``rising`` or ``falling``.
    trigger_timeout_s : s
        Time to wait for that edge.
    """

    model_config = STRICT
    driver: Literal["ni"]
    sample_rate_hz: Positive
    block_s: Annotated[float, Field(gt=0.001, le=10)] = 0.1
    buffer_s: Annotated[float, Field(ge=0.2, le=600)] = 10.0
    timeout_s: Positive = 5.0
    sample_clock: str = ""
    reference_clock: str = ""
    reference_clock_hz: Positive | None = None
    sync_pulse: str = ""
    start_trigger: str = ""
    start_edge: Literal["rising", "falling"] = "rising"
    trigger_timeout_s: Positive = 600.0

    def set_timing(self, task: Any) -> None:
        from nidaqmx import constants

        task.timing.cfg_samp_clk_timing(
            self.sample_rate_hz, source=self.sample_clock, sample_mode=constants.AcquisitionType.CONTINUOUS
        )
        if self.reference_clock:
            task.timing.ref_clk_src = self.reference_clock
            if self.reference_clock_hz is not None:
                task.timing.ref_clk_rate = self.reference_clock_hz
        if self.sync_pulse:
            task.timing.sync_pulse_src = self.sync_pulse
        if self.start_trigger:
            edge = constants.Edge.RISING if self.start_edge == "rising" else constants.Edge.FALLING
            task.triggers.start_trigger.cfg_dig_edge_start_trig(self.start_trigger, trigger_edge=edge)

    def check_clocks(self, task: Any, devices: str) -> None:
        """Read back the sources of the clocks; refuse sources that differ from the request."""
        for clock, requested, attribute in (
            ("sample clock", self.sample_clock, "samp_clk_src"),
            ("reference clock", self.reference_clock, "ref_clk_src"),
            ("sync pulse", self.sync_pulse, "sync_pulse_src"),
        ):
            actual = str(getattr(task.timing, attribute)) if requested else ""
            if actual.strip("/").lower() != requested.strip("/").lower():
                raise InputError(
                    f"{devices}: {clock} is {actual!r}, not {requested!r} as requested; correct it in the session"
                )


class NiSource:
    """Inputs of one or several modules on one sample clock, read without a gap.

    The task is set up once when the source is made, so that the achieved rate, the input delays and all settings are
    known before the recording. A difference from the request then is an error or an entry of `notices`. `open` sets the
    task up again and starts it. Overloads and open loops that the modules report are logged in the series `devices`.

    Parameters
    ----------
    device
        Sample rate, buffer, clocks and trigger.
    inputs
        Inputs, each with the sensor that is wired to it.
    counters
        Counters that are read at each sample, after the inputs.
    duration : s
        Time to record; None: until stopped.
    title, setup
        Title and set-up of the recording.
    """

    def __init__(
        self,
        device: NiDevice,
        inputs: Sequence[ChannelTable],
        counters: Sequence[CounterTable] = (),
        *,
        duration: float | None = None,
        title: str = "",
        setup: str = "",
    ) -> None:
        if not inputs:
            raise InputError("an NI source needs at least one input; add a table [[channels]] to the session")
        self.title, self.setup = title, setup
        self._inputs, self._counters = tuple(inputs), tuple(counters)
        self._device = device
        self._device_names = tuple(dict.fromkeys([*(i.device for i in inputs), *(c.device for c in counters)]))
        self._devices = " ".join(self._device_names)
        self._scales = np.array([channel.scale for channel in inputs])
        self._task: Any = None
        self._reader: Any = None
        self._status: NiStatus | None = None
        self._counter_readers: list[CounterReader] = []
        self._opened = ExitStack()
        self._pending: deque[Events] = deque()
        self._n_read = 0
        self.event_series: dict[str, EventAxis] = {DEVICES: DEVICES_AXIS}
        self.notices: tuple[str, ...] = ()
        with ExitStack() as stack:
            task, created = self._configured_task(stack)
            with translating_errors(self._devices):
                rate = float(task.timing.samp_clk_rate)
                channels = self._recorded_channels(task, created)
        self._check_rate(rate)
        self.streams: tuple[StreamDescription, ...] = (StreamDescription("ni", rate, 0.0, channels),)
        self._block_length = max(1, round(device.block_s * rate))
        self.n_samples: int | None = None if duration is None else round(duration * rate)

    @property
    def sample_rate(self) -> float:
        return self.streams[0].sample_rate

    def _configured_task(self, stack: ExitStack) -> tuple[Any, list[Any]]:
        """Make a task that is ready to start, and DAQmx's objects of its channels; ``stack`` closes it."""
        with translating_errors(self._devices):
            import nidaqmx  # here, so that a missing package is reported as DriverMissing

            task = nidaqmx.Task()
            stack.callback(self._close_task, task)
            created = [channel.add_to(task.ai_channels) for channel in self._inputs]
            self._device.set_timing(task)
            task.in_stream.input_buf_size = int(self._device.buffer_s * task.timing.samp_clk_rate)
        return task, created

    def _close_task(self, task: Any) -> None:
        """Clear a task, in any state of its device."""
        with suppress(DeviceError, InputError), translating_errors(self._devices):
            task.close()

    def _recorded_channels(self, task: Any, created: Sequence[Any]) -> tuple[Channel, ...]:
        """Return the channels with the settings that the driver reports; refuse settings that were not requested."""
        self._device.check_clocks(task, self._devices)
        devices = {name: identity(name) for name in self._device_names}
        channels, mistakes = [], []
        for requested, channel in zip(self._inputs, created, strict=True):
            settings = requested.read_back(channel)
            mistakes += requested.mismatches(settings)
            teds = sensor_identity(requested.terminal) if requested.teds else ""
            channels.append(requested.recorded_channel(settings, input_delay(channel), devices[requested.device], teds))
            range_volts = settings["range_v"] or requested.range_v
            if range_volts > 1.001 * requested.range_v:
                self.notices += (
                    f"channel {requested.name}: range {requested.range_v:g} V requested, {range_volts:g} V used",
                )
        if mistakes:
            raise InputError(f"{'; '.join(mistakes)}; correct the session or the wiring")
        return (*channels, *(counter.recorded_channel(devices[counter.device]) for counter in self._counters))

    def _check_rate(self, rate: float) -> None:
        """Refuse a rate below the request; add a notice for a higher rate."""
        requested, tolerance = self._device.sample_rate_hz, SETTINGS.sample_rate_tolerance
        if rate < (1 - tolerance) * requested:
            raise InputError(
                f"{self._devices}: sample_rate_hz {requested:g} is above the device's highest rate, {rate:.9g} Hz; "
                "request that or less"
            )
        if rate > (1 + tolerance) * requested:
            self.notices += (f"sample rate {requested:g} Hz requested, {rate:.9g} Hz used",)

    def open(self) -> None:
        """Start the task; with a trigger the samples begin at its edge."""
        self.close()
        with ExitStack() as stack:
            self._task, _ = self._configured_task(stack)
            with translating_errors(self._devices):
                from nidaqmx.stream_readers import AnalogMultiChannelReader

                self._reader = AnalogMultiChannelReader(self._task.in_stream)
                self._reader.verify_array_shape = False
                # counters wait for the inputs' sample clock: started first, they miss none of its ticks
                self._start_counters(stack)
                self._status = NiStatus(self._task)
                self._n_read = 0
                self._pending.clear()
                self._task.start()
            self._armed = time.monotonic()
            self._opened = stack.pop_all()

    def _start_counters(self, stack: ExitStack) -> None:
        self._counter_readers = []
        source = str(self._task.timing.samp_clk_term) if self._counters else ""
        for counter in self._counters:
            task = counter.task(self.sample_rate, source, int(self._device.buffer_s * self.sample_rate))
            stack.callback(self._close_task, task)
            task.start()
            self._counter_readers.append(CounterReader(task))

    def read(self) -> Block | Events | None:
        """Wait for the next block, or return the faults that the modules reported; None when the duration is over."""
        if self._task is None:
            return None
        if self._pending:
            return self._pending.popleft()
        left = self._block_length if self.n_samples is None else self.n_samples - self._n_read
        length = min(self._block_length, left)
        if length <= 0:
            return None
        if self._device.start_trigger and self._n_read == 0 and not self._is_triggered():
            return Events(DEVICES, np.empty(0), np.empty(0), None, ())  # no event, so that the caller can stop
        return self._read_block(length)

    def _is_triggered(self) -> bool:
        """Return whether samples have come; wait for a moment if not."""
        with translating_errors(self._devices):
            if int(self._task.in_stream.total_samp_per_chan_acquired):
                return True
        waited = time.monotonic() - self._armed
        if waited > self._device.trigger_timeout_s:
            raise DeviceTimeout(
                f"{self._devices}: no edge at the start trigger {self._device.start_trigger} for {waited:.3g} s; check "
                "its wire and start_edge"
            )
        time.sleep(0.05)
        return False

    def _read_block(self, length: int) -> Block:
        raw = np.empty((len(self._inputs), length))
        timeout = self._device.timeout_s + length / self.sample_rate
        try:
            with translating_errors(self._devices):
                self._reader.read_many_sample(raw, length, timeout)
                counts = [reader.read(length, timeout) for reader in self._counter_readers]
        except Overrun as error:
            raise self._with_count(error) from error
        first, self._n_read = self._n_read, self._n_read + length
        return self._block(first, raw, counts)

    def _block(self, first: int, raw: Real, counts: Sequence[Real]) -> Block:
        """Make the block; also read the sample count and the host's time now, as a pair for the clock."""
        with translating_errors(self._devices):
            n_acquired = int(self._task.in_stream.total_samp_per_chan_acquired)
            now = time.monotonic()  # after the count: a pair may be late, never early
            if self._status is not None:
                block_end = now - (n_acquired - self._n_read) / self.sample_rate
                self._pending.extend(self._status.changes(block_end - raw.shape[1] / self.sample_rate))
        samples = np.ascontiguousarray(raw.T) * self._scales
        if counts:
            samples = np.column_stack([samples, *counts])
        return Block(self.streams[0].name, first, samples, now, n_acquired)

    def _with_count(self, error: Overrun) -> Overrun:
        """Add the number of samples that the driver dropped, if it still reports it."""
        missing = None
        with suppress(DeviceError), translating_errors(self._devices):
            n_acquired = int(self._task.in_stream.total_samp_per_chan_acquired)
            missing = max(n_acquired - int(self._task.in_stream.input_buf_size) - self._n_read, 1)
        if missing is None:
            return error
        return Overrun(f"{error}; {missing} samples a channel are missing after sample {self._n_read}", missing)

    def close(self) -> None:
        self._task, self._reader, self._status, self._counter_readers = None, None, None, []
        self._opened.close()
