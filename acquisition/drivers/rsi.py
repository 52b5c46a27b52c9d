"""Joint angles, position and motor currents of a KUKA robot, through its Robot Sensor Interface (RSI)."""

import math
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO
from xml.etree import ElementTree

import numpy as np

from ..errors import DeviceTimeout, Disconnected
from ..sources.receiving import Put, ThreadedFeed
from ..sources.source import EventAxis, Events
from ..sources.timing import Stamped, SteadyStamps
from . import rsi_answering

CYCLES = (4, 12)
"""ms between two packets: the fast and the standard cycle of the controller."""

_TO_DECIDE = 5
_DRIFT = 200e-6


@dataclass(frozen=True)
class RsiPacket:
    """One packet of the controller.

    Parameters
    ----------
    ipoc
        Its time in the controller's clock, ms.
    values
        Values by ``Element.Attribute``, such as ``AIPos.A1``, in the controller's units.
    """

    ipoc: int
    values: dict[str, float]


def understood(data: bytes) -> RsiPacket | None:
    """The packet in these bytes, or None where they are none."""
    if b"<!" in data:  # no packet of a controller has declarations; entities could fill the memory
        return None
    try:
        root = ElementTree.fromstring(data)
        ipoc = int(root.findtext("IPOC", ""))
    except (ElementTree.ParseError, ValueError):
        return None
    values: dict[str, float] = {}
    for element in root:
        for name, text in element.attrib.items():
            try:
                values[f"{element.tag}.{name}"] = float(text)
            except ValueError:
                continue
    return RsiPacket(ipoc, values)


@dataclass(frozen=True)
class Arrived:
    """What a packet's arrival tells.

    Parameters
    ----------
    n_lost
        Packets missing before it.
    lateness : s
        Time by which it came late, where that is more than a cycle; else 0.
    repeated
        Whether it came before.
    restarted
        Whether the controller's clock began anew.
    """

    n_lost: int = 0
    lateness: float = 0.0
    repeated: bool = False
    restarted: bool = False


class PacketCount:
    """Counts packets by their IPOC, which grows by the cycle from packet to packet.

    Parameters
    ----------
    cycle : ms
        Time between two packets; None: the commonest of the first steps tells.
    pause : ms
        Step of the IPOC from which on no packets were lost but the robot's program paused, or its clock began anew.
    """

    def __init__(self, cycle: int | None = None, pause: int = 1000) -> None:
        self.cycle, self._pause = cycle, pause
        self.n_came, self.n_lost, self.n_late = 0, 0, 0
        self._steps: Counter[int] = Counter()
        self._last: int | None = None
        self._least: tuple[float, float] | None = None
        self._missing: set[int] = set()

    def take(self, packet: RsiPacket, arrival: float) -> Arrived:
        """Count a packet that arrived at a host's monotonic time (s)."""
        last, self._last = self._last, packet.ipoc
        self.n_came += 1
        if last is None or abs(packet.ipoc - last) > self._pause:
            self._least = None
            self._missing.clear()
            self._remember(packet, arrival)
            return Arrived(restarted=last is not None and packet.ipoc < last)
        step = packet.ipoc - last
        if step <= 0:
            self._last = last
            return self._overtaken(packet, arrival)
        return Arrived(self._gap(last, step), self._late(packet, arrival))

    def _gap(self, last: int, step: int) -> int:
        """Packets missing in a step of the IPOC."""
        if self.cycle is None:
            self._steps[step] += 1
            if self._steps.total() < _TO_DECIDE:
                return 0
            common = self._steps.most_common(1)[0][0]
            self.cycle = min(CYCLES, key=lambda one: abs(one - common))
            n_lost = sum(max(round(one / self.cycle) - 1, 0) * count for one, count in self._steps.items())
        else:
            n_lost = max(round(step / self.cycle) - 1, 0)
            self._missing.update(last + self.cycle * (k + 1) for k in range(min(n_lost, 1000)))
        self.n_lost += n_lost
        return n_lost

    def _overtaken(self, packet: RsiPacket, arrival: float) -> Arrived:
        """A packet that a later one overtook is not lost but late; one that came before is neither."""
        if packet.ipoc not in self._missing:
            self.n_came -= 1
            return Arrived(repeated=True)
        self._missing.discard(packet.ipoc)
        self.n_lost -= 1
        return Arrived(-1, self._late(packet, arrival, overtaken=True))

    def _late(self, packet: RsiPacket, arrival: float, *, overtaken: bool = False) -> float:
        """Time by which a packet came late, s; 0 where that is less than a cycle and no other overtook it."""
        usual, late = self._usual(arrival), arrival - 1e-3 * packet.ipoc
        self._remember(packet, arrival)
        beyond = late - usual
        if beyond <= 1e-3 * (self.cycle or CYCLES[-1]) and not overtaken:
            return 0.0
        self.n_late += 1
        return beyond

    def _usual(self, arrival: float) -> float:
        """The least lateness so far, which may grow as fast as clocks drift."""
        assert self._least is not None
        at, least = self._least
        return least + _DRIFT * (arrival - at)

    def _remember(self, packet: RsiPacket, arrival: float) -> None:
        late = arrival - 1e-3 * packet.ipoc
        if self._least is None or late <= self._usual(arrival):
            self._least = (arrival, late)


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
