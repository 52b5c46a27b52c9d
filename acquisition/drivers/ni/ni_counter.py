"""A counter beside the inputs: an angular encoder or edges, one value a sample of the inputs' clock."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ...channel import Channel


@dataclass(frozen=True)
class NiCounter:
    """One counter with what is wired to it.

    Parameters
    ----------
    channel
        Name and place; its quantity is an angle (rad) for an encoder, dimensionless for edges.
    counter
        Name of the counter, such as ``cDAQ1/_ctr0``.
    kind
        ``encoder``: signals A and B of an incremental encoder; ``edges``: rising edges of one signal.
    pulses_per_revolution
        Pulses of A a revolution.
    decoding
        Edges that count: ``x1``, ``x2`` or ``x4``.
    index
        Whether signal Z sets the angle to zero once a revolution.

    Raises
    ------
    InputError
        A quantity that a counter does not give.
    """

    channel: Channel
    counter: str
    kind: Literal["encoder", "edges"] = "encoder"
    pulses_per_revolution: int = 1024
    decoding: Literal["x1", "x2", "x4"] = "x4"
    index: bool = False

    def __post_init__(self) -> None:
        wanted = "angle" if self.kind == "encoder" else "dimensionless"
        if self.channel.quantity != wanted:
            raise InputError(
                f"counter {self.channel.name}: quantity {self.channel.quantity!r} does not go with {self.kind}; "
                f"give {wanted!r}"
            )

    @property
    def device(self) -> str:
        """The device of the counter: ``cDAQ1``."""
        return self.counter.split("/")[0]

    def described(self, identity: dict[str, str]) -> Channel:
        """The channel as recorded; a counter has no filter, so that its values are not late."""
        extra = {**self.channel.extra, "terminal": self.counter, "kind": self.kind, "device": identity}
        if self.kind == "encoder":
            extra |= {"pulses_per_revolution": self.pulses_per_revolution, "decoding": self.decoding}
        return replace(self.channel, input_delay_s=self.channel.input_delay_s or 0.0, extra=extra)

    def task(self, rate: float, sample_clock: str, buffer: int) -> Any:
        """A DAQmx task that takes one value at each tick of the inputs' sample clock; start it before them."""
        import nidaqmx
        from nidaqmx import constants

        task = nidaqmx.Task()
        try:
            if self.kind == "edges":
                task.ci_channels.add_ci_count_edges_chan(self.counter, self.channel.name, edge=constants.Edge.RISING)
            else:
                task.ci_channels.add_ci_ang_encoder_chan(
                    self.counter,
                    self.channel.name,
                    decoding_type=constants.EncoderType[f"X_{self.decoding[1]}"],
                    zidx_enable=self.index,
                    units=constants.AngleUnits.RADIANS,
                    pulses_per_rev=self.pulses_per_revolution,
                )
            mode = constants.AcquisitionType.CONTINUOUS
            task.timing.cfg_samp_clk_timing(rate, source=sample_clock, sample_mode=mode)
            task.in_stream.input_buf_size = buffer
        except BaseException:
            task.close()
            raise
        return task


class CounterReading:
    """A running counter task, read block by block.

    Parameters
    ----------
    task
        The task of `NiCounter.task`.
    """

    def __init__(self, task: Any) -> None:
        from nidaqmx.stream_readers import CounterReader

        self.task = task
        self._reader = CounterReader(task.in_stream)
        self._reader.verify_array_shape = False

    def read(self, length: int, timeout: float) -> NDArray[np.float64]:
        """The next values (length,); waits ``timeout`` seconds at most."""
        values = np.empty(length)
        self._reader.read_many_sample_double(values, length, timeout)
        return values

    def close(self) -> None:
        """Stop and clear the task."""
        self.task.close()
