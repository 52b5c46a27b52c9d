"""National Instruments modules through DAQmx: accelerometers, dynamometer and tachometer in one task, continuously."""

import contextlib
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..errors import DeviceError, Overrun
from ..sources import Block, StreamDescription
from .ni_channels import NiInput, input_delay
from .ni_errors import speaking_to

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

    The task is set up once when the source is made, so that the achieved rate and the modules' input delays are known
    before recording; `open` sets it up again and starts it.

    Parameters
    ----------
    inputs
        Inputs, each with the sensor that is wired to it.
    sample_rate : Hz
        Wanted sample rate; `streams` says what the device made of it.
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
        The device cannot be set up.
    """

    def __init__(
        self,
        inputs: Sequence[NiInput],
        sample_rate: float,
        *,
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
        self._inputs = tuple(inputs)
        self._wished_rate = sample_rate
        self._timeout = timeout
        self._buffer_duration = buffer_duration
        self._devices = " ".join(dict.fromkeys(each.device for each in inputs))
        self._scales = np.array([each.scale for each in inputs])
        self._task: Any = None
        self._reader: Any = None
        self._taken = 0
        task, delays = self._configured()
        with contextlib.closing(task), speaking_to(self._devices):
            rate = float(task.timing.samp_clk_rate)
        channels = tuple(each.described(delay) for each, delay in zip(inputs, delays, strict=True))
        self.streams: tuple[StreamDescription, ...] = (StreamDescription(name, rate, 0.0, channels),)
        self._block_length = max(1, round(block_duration * rate))
        self.n_samples: int | None = None if duration is None else round(duration * rate)

    @property
    def sample_rate(self) -> float:
        """The achieved rate, Hz."""
        return self.streams[0].sample_rate

    def _configured(self) -> tuple[Any, list[float | None]]:
        """A task ready to start, and the input delay of each channel, s."""
        with speaking_to(self._devices):
            import nidaqmx
            from nidaqmx.constants import AcquisitionType

            task = nidaqmx.Task()
            try:
                created = [each.add_to(task.ai_channels) for each in self._inputs]
                task.timing.cfg_samp_clk_timing(self._wished_rate, sample_mode=AcquisitionType.CONTINUOUS)
                task.in_stream.input_buf_size = int(self._buffer_duration * task.timing.samp_clk_rate)
                delays = [input_delay(channel) for channel in created]
            except BaseException:
                task.close()
                raise
        return task, delays

    def open(self) -> None:
        """Start the task.

        Raises
        ------
        DeviceError
            As on making the source.
        """
        self.close()
        self._task, _ = self._configured()
        with speaking_to(self._devices):
            from nidaqmx.stream_readers import AnalogMultiChannelReader

            self._reader = AnalogMultiChannelReader(self._task.in_stream)
            self._reader.verify_array_shape = False
            self._taken = 0
            self._task.start()

    def read(self) -> Block | None:
        """The next block, waited for; None when the duration is over.

        Raises
        ------
        Overrun
            With the number of samples a channel that are missing.
        DeviceTimeout, Disconnected, DeviceError
            The device stopped giving samples.
        """
        if self._task is None:
            return None
        left = self._block_length if self.n_samples is None else self.n_samples - self._taken
        length = min(self._block_length, left)
        if length <= 0:
            return None
        raw = np.empty((len(self._inputs), length))
        try:
            with speaking_to(self._devices):
                self._reader.read_many_sample(raw, length, self._timeout + length / self.sample_rate)
        except Overrun as error:
            raise self._counted(error) from error
        first, self._taken = self._taken, self._taken + length
        return self._block(first, raw)

    def _block(self, first: int, raw: NDArray[np.float64]) -> Block:
        """The block with a pair of sample count and host time, both taken now."""
        with speaking_to(self._devices):
            count = int(self._task.in_stream.total_samp_per_chan_acquired)
            noticed = time.monotonic()  # after asking: a pair may be late, never early
        samples = np.ascontiguousarray(raw.T) * self._scales
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
        """Stop and clear the task; harmless when not open."""
        task, self._task, self._reader = self._task, None, None
        if task is not None:
            with contextlib.suppress(DeviceError), speaking_to(self._devices):
                task.close()
