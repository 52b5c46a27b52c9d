"""Joint angles, position and motor currents of a KUKA robot, through its Robot Sensor Interface (RSI)."""

import math
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import IO, Annotated, Literal
from xml.etree import ElementTree

from pydantic import BaseModel, Field

from ..channels import STRICT, Name, Positive
from ..settings import SETTINGS
from ..sources.feeds import ThreadedFeed
from ..sources.source import DeviceTimeout, Disconnected, EventAxis
from ..sources.timing import StampedValue, SteadyStamps, to_events
from . import rsi_answering

CYCLES = (4, 12)  # ms between two packets: the fast and the standard cycle of the controller
RSI_COUNTS = ("rsi_lost", "rsi_late", "rsi_delay")  # event series that are empty if all is well


@dataclass(frozen=True)
class RsiPacket:
    """One packet of the controller, in the controller's units: time ``ipoc`` (ms), values by ``Element.Attribute``."""

    ipoc: int
    values: dict[str, float]


def parse_packet(data: bytes) -> RsiPacket | None:
    """Parse the XML of a packet; return None if it is no packet."""
    if b"<!" in data:  # packets of a controller have no declarations; entities could fill the memory
        return None
    try:
        root = ElementTree.fromstring(data)
        ipoc = int(root.findtext("IPOC", ""))
    except (ElementTree.ParseError, ValueError):
        return None
    values: dict[str, float] = {}
    for element in root:
        for name, text in element.attrib.items():
            with suppress(ValueError):
                values[f"{element.tag}.{name}"] = float(text)
    return RsiPacket(ipoc, values)


@dataclass(frozen=True)
class PacketArrival:
    """Findings on the arrival of one packet.

    ``n_lost`` is the number of packets missing before it (-1: the packet itself was counted as lost). ``lateness`` is
    the time by which it is late, s, 0 if less than a cycle. ``repeated``: the packet came before. ``restarted``: the
    clock of the controller restarted.
    """

    n_lost: int = 0
    lateness: float = 0.0
    repeated: bool = False
    restarted: bool = False


class PacketCounter:
    """Counts lost and late packets by their time stamp (IPOC), which grows by one cycle from packet to packet.

    ``cycle`` is the time between two packets, ms; None: determined from the first packets. A step of more than
    ``pause`` (ms) is a pause of the robot's program or a restart of its clock, not a loss.
    """

    def __init__(self, cycle: int | None = None, pause: int = 1000) -> None:
        self.cycle, self._pause = cycle, pause
        self.n_received, self.n_lost, self.n_late = 0, 0, 0
        self._steps: Counter[int] = Counter()
        self._last: int | None = None
        self._least_lateness: tuple[float, float] | None = None  # host's time, and lateness
        self._missing: set[int] = set()

    def add(self, packet: RsiPacket, arrival: float) -> PacketArrival:
        """Count a packet that arrived at ``arrival``, the host's monotonic time, s."""
        last, self._last = self._last, packet.ipoc
        self.n_received += 1
        if last is None or abs(packet.ipoc - last) > self._pause:
            self._least_lateness = None
            self._missing.clear()
            self._remember(packet, arrival)
            return PacketArrival(restarted=last is not None and packet.ipoc < last)
        step = packet.ipoc - last
        if step <= 0:
            self._last = last
            return self._add_overtaken(packet, arrival)
        return PacketArrival(self._count_lost(last, step), self._lateness(packet, arrival))

    def _count_lost(self, last: int, step: int) -> int:
        """Count the packets missing in a step of the time stamp."""
        if self.cycle is None:
            self._steps[step] += 1
            if self._steps.total() < SETTINGS.packets_for_cycle:
                return 0
            common = self._steps.most_common(1)[0][0]
            self.cycle = min(CYCLES, key=lambda cycle: abs(cycle - common))
            n_lost = sum(max(round(size / self.cycle) - 1, 0) * count for size, count in self._steps.items())
        else:
            n_lost = max(round(step / self.cycle) - 1, 0)
            # the limit bounds the memory: a damaged time stamp may announce any number
            self._missing.update(last + self.cycle * (k + 1) for k in range(min(n_lost, 1000)))
        self.n_lost += n_lost
        return n_lost

    def _add_overtaken(self, packet: RsiPacket, arrival: float) -> PacketArrival:
        """Count a packet that comes after a later one as late and not lost, unless it came before."""
        if packet.ipoc not in self._missing:
            self.n_received -= 1
            return PacketArrival(repeated=True)
        self._missing.discard(packet.ipoc)
        self.n_lost -= 1
        return PacketArrival(-1, self._lateness(packet, arrival, overtaken=True))

    def _lateness(self, packet: RsiPacket, arrival: float, *, overtaken: bool = False) -> float:
        """Return the time by which a packet is late, s; 0 if less than a cycle and no other packet overtook it."""
        usual, late = self._usual_lateness(arrival), arrival - 1e-3 * packet.ipoc
        self._remember(packet, arrival)
        excess = late - usual
        if excess <= 1e-3 * (self.cycle or CYCLES[-1]) and not overtaken:
            return 0.0
        self.n_late += 1
        return excess

    def _usual_lateness(self, arrival: float) -> float:
        """Return the least lateness so far, s, plus the largest drift of the clocks since then."""
        assert self._least_lateness is not None
        time_of_least, least = self._least_lateness
        return least + SETTINGS.controller_drift * (arrival - time_of_least)

    def _remember(self, packet: RsiPacket, arrival: float) -> None:
        late = arrival - 1e-3 * packet.ipoc
        if self._least_lateness is None or late <= self._usual_lateness(arrival):
            self._least_lateness = (arrival, late)


class RsiSignalTable(BaseModel):
    """One value of a KUKA controller's packets.

    Parameters
    ----------
    signal
        Element and attribute of the controller's packet, such as ``AIPos.A1``.
    series
        Name of the event series in the recording.
    factor
        Factor to SI units.
    """

    model_config = STRICT
    signal: Annotated[str, Field(pattern=r"^\w+\.\w+$")]
    series: Name
    factor: float = 1.0


# joint angles, Cartesian position and motor currents (in the controller's unit), if the controller sends them
STANDARD_SIGNALS = tuple(
    RsiSignalTable(signal=signal, series=series, factor=factor)
    for signal, series, factor in (
        *((f"AIPos.A{k}", f"joint_{k}_rad", math.pi / 180) for k in range(1, 7)),
        *((f"RIst.{axis}", f"tcp_{axis.lower()}_m", 1e-3) for axis in "XYZ"),
        *((f"RIst.{axis}", f"tcp_{axis.lower()}_rad", math.pi / 180) for axis in "ABC"),
        *((f"MACur.A{k}", f"motor_current_{k}", 1.0) for k in range(1, 7)),
    )
)


class RsiTable(BaseModel):
    """A KUKA robot.

    Parameters
    ----------
    address
        Network address of this computer in the robot's network.
    port
        UDP port to which the controller sends.
    robot
        Network address of the controller; packets of others are ignored. Empty: any.
    signals
        Values to keep; empty: joint angles, position and motor currents.
    cycle_ms : ms
        Time between two packets; left out: determined from the packets.
    silence_s : s
        Time without a packet after which the controller counts as lost.
    sentype
        Name that the controller's configuration expects in the answers (SENTYPE).
    """

    model_config = STRICT
    address: Name
    port: Annotated[int, Field(ge=1, le=65535)] = 59152
    robot: str = ""
    signals: tuple[RsiSignalTable, ...] = ()
    cycle_ms: Literal[4, 12] | None = None
    silence_s: Positive = 1.0
    sentype: Annotated[str, Field(pattern=r"^\w+$")] = "ImFree"


class RsiFeed(ThreadedFeed):
    """Server for a KUKA controller that answers each packet with its time stamp and never with a correction.

    A separate process (`rsi_answering`) answers, so that a busy recorder does not stop the robot. Times are those of
    the controller's clock, the IPOC. The series ``rsi_lost`` counts lost packets (gaps in the IPOC), ``rsi_late`` holds
    the lateness of late packets (s), and ``rsi_delay`` the number of late answers that the controller counts.
    """

    def __init__(self, table: RsiTable) -> None:
        self._table = table
        self._signals = table.signals or STANDARD_SIGNALS
        axis = EventAxis("device", f"rsi:{table.port}")
        series = [*(signal.series for signal in self._signals), *RSI_COUNTS]
        super().__init__(f"RSI {table.address}:{table.port}", dict.fromkeys(series, axis))
        self._child: _AnsweringProcess | None = None
        self._reset()

    def _reset(self) -> None:
        pause = round(1e3 * self._table.silence_s)
        self._counter, self._stamps = PacketCounter(self._table.cycle_ms, pause), SteadyStamps()
        self._n_unreadable, self._delay = 0, 0.0
        self._clear: list[StampedValue] = []  # values with clear times, which are put together

    def _connect(self) -> None:
        self._reset()
        self._start_child()

    def _reconnect(self) -> None:
        if self._child is None or not self._child.alive:
            self._release()
            self._start_child()

    def _start_child(self) -> None:
        table = self._table
        arguments = [table.address, str(table.port), table.robot or "any", table.sentype]
        self._child = _AnsweringProcess(arguments, self.where)

    def _suspend(self) -> None:
        """Keep answering, because the port belongs to this computer and the controller may send again at any time."""

    def _receive(self) -> None:
        child, silence = self._child, self._table.silence_s
        assert child is not None
        last_packet = time.monotonic()
        try:
            while not self._stopped.is_set():
                for arrival, data in child.frames(0.1):
                    last_packet = max(last_packet, arrival)
                    self._take(data, arrival)
                self._put_clear()
                if not child.alive:
                    raise Disconnected(f"{self.where}: the answering process ended ({child.complaint()}); try again")
                if time.monotonic() - last_packet > silence:
                    reason = f"no packet for {silence:g} s; check the robot's program, RSI_ON and its IP_NUMBER"
                    raise DeviceTimeout(f"{self.where}: {reason}", last_packet)
        finally:
            self._clear += self._stamps.flush()
            self._put_clear()

    def _take(self, data: bytes, arrival: float) -> None:
        """Count a packet and keep its values until their times are clear."""
        packet = parse_packet(data)
        if packet is None:
            self._n_unreadable += 1
            return
        findings = self._counter.add(packet, arrival)
        if findings.repeated:
            return
        values = self._values(packet)
        if findings.n_lost > 0:
            values["rsi_lost"] = float(findings.n_lost)
        if findings.lateness:
            values["rsi_late"] = findings.lateness
        if findings.restarted:
            self.note("controller's clock restarted", arrival)
        for series, value in values.items():
            self._clear += self._stamps.add(StampedValue(series, value, 1e-3 * packet.ipoc, arrival))

    def _values(self, packet: RsiPacket) -> dict[str, float]:
        """Return the selected values of a packet, in SI units, by series."""
        present = [signal for signal in self._signals if signal.signal in packet.values]
        values = {signal.series: packet.values[signal.signal] * signal.factor for signal in present}
        delay = packet.values.get("Delay.D", 0.0)
        if delay != self._delay:
            values["rsi_delay"] = self._delay = delay
        return values

    def _put_clear(self) -> None:
        for step_time, step in self._stamps.steps():
            self.note(f"controller's clock stepped by {step:+.3f} s, removed", step_time)
        self._put(to_events(sorted(self._clear, key=lambda value: value.stamp)))
        self._clear = []

    def conclude(self) -> None:
        """Note how many packets were received, lost, late or unreadable."""
        super().conclude()
        counter = self._counter
        expected = counter.n_received + counter.n_lost
        unreadable = f", {self._n_unreadable} unreadable" if self._n_unreadable else ""
        self.note(f"{counter.n_lost} of {expected} packets lost, {counter.n_late} late{unreadable}")

    def _release(self) -> None:
        child, self._child = self._child, None
        if child is not None:
            child.close()


class _AnsweringProcess:
    """The process `rsi_answering`, and a thread that takes the frames that the process writes."""

    def __init__(self, arguments: Sequence[str], where: str) -> None:
        command = [sys.executable, "-I", str(Path(rsi_answering.__file__)), *arguments]
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(  # in a session of its own, so that Ctrl-C does not reach it
            command, stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True
        )
        self._frames: SimpleQueue[tuple[float, bytes] | None] = SimpleQueue()
        self._thread = threading.Thread(target=self._read, name=f"{where} frames", daemon=True)
        self._thread.start()
        self.alive = True
        try:
            first_frame = self._frames.get(timeout=10.0)
        except Empty:
            first_frame = None
        if first_frame is None:
            reason = self.complaint()
            self.close()
            raise Disconnected(
                f"{where} cannot be opened: {reason}; check address and port, and that no other uses them"
            )

    def _read(self) -> None:
        assert self._process.stdout is not None
        while head := _exactly(self._process.stdout, rsi_answering.FRAME.size):
            arrival, length = rsi_answering.FRAME.unpack(head)
            data = _exactly(self._process.stdout, length)
            if data is None:
                break
            self._frames.put((1e-9 * arrival, data))
        self._frames.put(None)

    def frames(self, duration: float) -> list[tuple[float, bytes]]:
        """Return the packets of the next ``duration`` seconds, each with the host's time of arrival, s."""
        packets, deadline = [], time.monotonic() + duration
        while self.alive and (left := deadline - time.monotonic()) > 0:
            try:
                frame = self._frames.get(timeout=left)
            except Empty:
                break
            if frame is None:
                self.alive = False
            else:
                packets.append(frame)
        return packets

    def complaint(self) -> str:
        """Return the error text that the process wrote at its end."""
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
    """Read ``size`` bytes, or None at the end of the pipe."""
    data = pipe.read(size) if size else b""
    return data if len(data) == size else None
