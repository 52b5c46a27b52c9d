"""Joint angles, position and motor currents of a KUKA robot, through its Robot Sensor Interface (RSI)."""

import math
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO

import numpy as np

from ...errors import DeviceTimeout, Disconnected
from ...sources import EventAxis, Events, Put, Stamped, SteadyStamps, ThreadedFeed
from . import rsi_answering
from .rsi_packet import PacketCount, RsiPacket, understood

_READY = 10.0
_BATCH = 0.1


@dataclass(frozen=True)
class RsiSignal:
    """One value of the controller's packets as a series of events.

    Parameters
    ----------
    signal
        Element and attribute: ``AIPos.A1``.
    series
        Name of its event series in the recording.
    factor
        Factor to SI units.
    """

    signal: str
    series: str
    factor: float = 1.0


STANDARD_SIGNALS = (
    *(RsiSignal(f"AIPos.A{k}", f"joint_{k}_rad", math.pi / 180) for k in range(1, 7)),
    *(RsiSignal(f"RIst.{axis}", f"tcp_{axis.lower()}_m", 1e-3) for axis in "XYZ"),
    *(RsiSignal(f"RIst.{axis}", f"tcp_{axis.lower()}_rad", math.pi / 180) for axis in "ABC"),
    *(RsiSignal(f"MACur.A{k}", f"motor_current_{k}") for k in range(1, 7)),
)
"""Joint angles, Cartesian position and motor currents (in the controller's unit), where the controller sends them."""


RSI_COUNTS = ("rsi_lost", "rsi_late", "rsi_delay")
"""Series of lost and late packets, and of late answers as the controller counts them; empty where all is well."""


class RsiFeed(ThreadedFeed):
    """A server for a KUKA controller: it answers each packet with its IPOC and never with a correction.

    The answers come from a process of their own (`rsi_answering`), so that a busy recorder does not stop the robot.
    Times are those of the controller's clock, the IPOC. Lost packets (gaps in the IPOC) are the series ``rsi_lost``,
    late ones ``rsi_late`` (s), and what the controller itself counts as late answers ``rsi_delay``.

    Parameters
    ----------
    address, port
        Network address of this computer in the robot's network, and the UDP port that the controller sends to.
    robot
        Network address of the controller; others are not heard. Empty: any.
    signals
        Values to keep.
    cycle : ms
        Time between two packets, 4 or 12; None: the packets tell.
    silence : s
        Time without a packet after which the controller counts as lost.
    sentype
        Name that the controller's configuration expects in the answers (SENTYPE).
    """

    def __init__(
        self,
        address: str,
        port: int,
        robot: str = "",
        signals: Sequence[RsiSignal] = STANDARD_SIGNALS,
        *,
        cycle: int | None = None,
        silence: float = 1.0,
        sentype: str = "ImFree",
    ) -> None:
        axis = EventAxis("device", f"rsi:{port}")
        super().__init__(
            f"RSI {address}:{port}",
            {**dict.fromkeys((s.series for s in signals), axis), **dict.fromkeys(RSI_COUNTS, axis)},
        )
        self._arguments = [address, str(port), robot or "any", sentype]
        self._signals, self._silence, self._cycle = tuple(signals), silence, cycle
        self._child: _Answering | None = None
        self._count, self._stamps = PacketCount(), SteadyStamps()
        self._n_odd, self._delay = 0, 0.0

    def _connect(self) -> None:
        self._count, self._stamps = PacketCount(self._cycle, round(1e3 * self._silence)), SteadyStamps()
        self._n_odd, self._delay = 0, 0.0
        self._child = _Answering(self._arguments, self.where)

    def _reconnect(self) -> None:
        if self._child is None or not self._child.alive:
            self._release()
            self._child = _Answering(self._arguments, self.where)

    def _let_go(self) -> None:
        """Keep answering: the port is this computer's, and the controller may send again at any time."""

    def _receive(self, put: Put, stopped: Callable[[], bool]) -> None:
        child = self._child
        assert child is not None
        batch, heard = _Batch(), time.monotonic()
        try:
            while not stopped():
                for arrival, data in child.frames(_BATCH):
                    heard = max(heard, arrival)
                    self._take(data, arrival, batch)
                self._hand_over(batch, put)
                if not child.alive:
                    raise Disconnected(f"{self.where}: the answering process ended ({child.complaint()}); try again")
                if time.monotonic() - heard > self._silence:
                    what = f"no packet for {self._silence:g} s; check the robot's program, RSI_ON and its IP_NUMBER"
                    raise DeviceTimeout(f"{self.where}: {what}", heard)
        finally:
            batch.clear += self._stamps.flush()
            self._hand_over(batch, put)

    def _take(self, data: bytes, arrival: float, batch: "_Batch") -> None:
        """Count a packet and keep its values until its time is clear."""
        packet = understood(data)
        if packet is None:
            self._n_odd += 1
            return
        came = self._count.take(packet, arrival)
        if came.repeated:
            return
        values = self._values(packet)
        if came.n_lost > 0:
            values["rsi_lost"] = float(came.n_lost)
        if came.lateness:
            values["rsi_late"] = came.lateness
        if came.restarted:
            self.note("controller's clock began anew", arrival)
        for series, value in values.items():
            batch.clear += self._stamps.add(Stamped(series, value, 1e-3 * packet.ipoc, arrival))

    def _values(self, packet: RsiPacket) -> dict[str, float]:
        """Wanted values of a packet, in SI units, by series."""
        there = ((each, packet.values.get(each.signal)) for each in self._signals)
        values = {each.series: value * each.factor for each, value in there if value is not None}
        delay = packet.values.get("Delay.D", 0.0)
        if delay != self._delay:
            values["rsi_delay"] = self._delay = delay
        return values

    def _hand_over(self, batch: "_Batch", put: Put) -> None:
        for at, step in self._stamps.steps():
            self.note(f"controller's clock stepped by {step:+.3f} s, taken out", at)
        for events in batch.taken():
            put(events)

    def conclude(self) -> None:
        """Note how many packets came, were lost, late or not understood."""
        super().conclude()
        count = self._count
        expected = count.n_came + count.n_lost
        odd = f", {self._n_odd} not understood" if self._n_odd else ""
        self.note(f"{count.n_lost} of {expected} packets lost, {count.n_late} late{odd}")

    def _release(self) -> None:
        child, self._child = self._child, None
        if child is not None:
            child.close()


@dataclass
class _Batch:
    """Values whose times are clear, handed over together: a file takes many at once much faster than one by one."""

    clear: list[Stamped] = field(default_factory=list)

    def taken(self) -> list[Events]:
        """One series each, in the order of its times."""
        by_series: dict[str, list[Stamped]] = {}
        for one in sorted(self.clear, key=lambda each: each.stamp):
            by_series.setdefault(one.series, []).append(one)
        self.clear = []
        return [_series(name, ones) for name, ones in by_series.items()]


def _series(name: str, ones: Sequence[Stamped]) -> Events:
    stamps, values, arrivals = (
        np.array([getattr(each, what) for each in ones]) for what in ("stamp", "value", "arrival")
    )
    return Events(name, stamps, values, arrivals)


class _Answering:
    """The answering process, and a thread that takes what it hears.

    Parameters
    ----------
    arguments
        Those of `rsi_answering`.
    where
        The device, for messages.
    """

    def __init__(self, arguments: Sequence[str], where: str) -> None:
        command = [sys.executable, "-I", str(Path(rsi_answering.__file__)), *arguments]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(  # a session of its own: Ctrl-C is not for it
            command, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
        )
        self._frames: SimpleQueue[tuple[float, bytes] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._read, name=f"{where} frames", daemon=True)
        self._thread.start()
        self.alive = True
        try:
            ready = self._frames.get(timeout=_READY)
        except Empty:
            ready = None
        if ready is None:
            said = self.complaint()
            self.close()
            raise Disconnected(f"{where} cannot be opened: {said}; check address and port, and that no other uses them")

    def _read(self) -> None:
        assert self._process.stdout is not None
        while True:
            head = _exactly(self._process.stdout, rsi_answering.FRAME.size)
            if head is None:
                break
            arrival, length = rsi_answering.FRAME.unpack(head)
            data = _exactly(self._process.stdout, length)
            if data is None:
                break
            self._frames.put((1e-9 * arrival, data))
        self._frames.put(None)

    def frames(self, duration: float) -> list[tuple[float, bytes]]:
        """What comes within a time (s): host's time of arrival (s) and the packet."""
        taken, latest = [], time.monotonic() + duration
        while self.alive and (left := latest - time.monotonic()) > 0:
            try:
                frame = self._frames.get(timeout=left)
            except Empty:
                break
            if frame is None:
                self.alive = False
            else:
                taken.append(frame)
        return taken

    def complaint(self) -> str:
        """What the process said as it ended."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(1.0)
        if self._process.poll() is None or self._process.stderr is None:
            return "no answer"
        return self._process.stderr.read().decode("utf-8", "replace").strip() or f"exit code {self._process.returncode}"

    def close(self) -> None:
        """End the process and wait for it."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._thread.join()
        for pipe in (self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()


def _exactly(pipe: IO[bytes], size: int) -> bytes | None:
    """So many bytes, or None at the end."""
    data = pipe.read(size) if size else b""
    return data if len(data) == size else None
