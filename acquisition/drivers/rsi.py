"""Joint angles, position and motor currents of a KUKA robot, through its Robot Sensor Interface (RSI)."""

import math
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated, Literal
from xml.etree import ElementTree

from pydantic import BaseModel, Field

from ..channels import STRICT, Name, Positive
from ..settings import SETTINGS
from ..sources.source import DeviceTimeout, Disconnected, EventAxis
from ..sources.threaded_feed import ThreadedFeed
from ..sources.timing import StampedValue, SteadyStamps, to_events
from .rsi_answering import DRIFT
from .rsi_process import AnsweringProcess

CYCLES = (4, 12)  # ms between two packets: the fast and the standard cycle of the controller
REASONS = {  # why packets are left out, as the answering process counts them
    "foreign": "of other senders",
    "overtaken": "out of order",
    "early": "stamped later than they came",
    "unreadable": "unreadable",
    "busy": "as the recorder was too busy to take them",
}
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

    ``n_lost`` is the number of packets missing before it. ``lateness`` is the time by which it is late, s, 0 if less
    than a cycle. ``restarted``: the clock of the controller restarted.
    """

    n_lost: int = 0
    lateness: float = 0.0
    restarted: bool = False


class PacketCounter:
    """Counts lost and late packets by their time stamp (IPOC), which grows by one cycle from packet to packet.

    ``cycle`` is the time between two packets, ms; None: determined from the first packets. A step of more than
    ``pause`` (ms) is a pause of the robot's program, and a step back a restart of its clock, not a loss.
    """

    def __init__(self, cycle: int | None = None, pause: int = 1000) -> None:
        self.cycle, self._pause = cycle, pause
        self.n_received, self.n_lost, self.n_late = 0, 0, 0
        self._steps: Counter[int] = Counter()
        self._last: int | None = None
        self._least_lateness: tuple[float, float] | None = None  # host's time, and lateness

    def add(self, packet: RsiPacket, arrival: float) -> PacketArrival:
        """Count a packet that arrived at ``arrival``, the host's monotonic time, s."""
        last, self._last = self._last, packet.ipoc
        self.n_received += 1
        if last is None or not 0 < packet.ipoc - last <= self._pause:
            self._least_lateness = None
            self._remember(packet, arrival)
            return PacketArrival(restarted=last is not None and packet.ipoc < last)
        return PacketArrival(self._count_lost(packet.ipoc - last), self._lateness(packet, arrival))

    def _count_lost(self, step: int) -> int:
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
        self.n_lost += n_lost
        return n_lost

    def _lateness(self, packet: RsiPacket, arrival: float) -> float:
        """Return the time by which a packet is late, s; 0 if less than a cycle."""
        usual, late = self._usual_lateness(arrival), arrival - 1e-3 * packet.ipoc
        self._remember(packet, arrival)
        if late - usual <= 1e-3 * (self.cycle or CYCLES[-1]):
            return 0.0
        self.n_late += 1
        return late - usual

    def _usual_lateness(self, arrival: float) -> float:
        """Return the least lateness so far, s, plus the largest drift of the clocks since then."""
        assert self._least_lateness is not None
        time_of_least, least = self._least_lateness
        return least + DRIFT * (arrival - time_of_least)

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
        Network address of the controller; packets of others are counted and left out. Empty: the first sender.
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

    A separate process (`rsi_answering`) answers, so that a busy recorder does not stop the robot, and leaves out the
    packets of other senders and those out of order. Times are those of the controller's clock, the IPOC. The series
    ``rsi_lost`` counts lost packets (gaps in the IPOC), ``rsi_late`` holds the lateness of late packets (s), and
    ``rsi_delay`` the number of late answers that the controller counts.
    """

    def __init__(self, table: RsiTable) -> None:
        self._table = table
        self._signals = table.signals or STANDARD_SIGNALS
        axis = EventAxis("device", f"rsi:{table.port}")
        series = [*(signal.series for signal in self._signals), *RSI_COUNTS]
        super().__init__(f"RSI {table.address}:{table.port}", dict.fromkeys(series, axis))
        self._child: AnsweringProcess | None = None
        self._reset()

    def _reset(self) -> None:
        pause = round(1e3 * self._table.silence_s)
        self._counter, self._stamps = PacketCounter(self._table.cycle_ms, pause), SteadyStamps()
        self._delay, self._has_stranger = 0.0, False
        self._left_out: Counter[str] = Counter()  # packets that earlier answering processes left out, by reason
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
        arguments = [table.address, str(table.port), table.robot or "any", table.sentype, str(table.silence_s)]
        self._child = AnsweringProcess(arguments, self.where)

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
                self._note_stranger(child.stranger)
                if not child.alive:
                    raise Disconnected(f"{self.where}: the answering process ended ({child.complaint()}); try again")
                if time.monotonic() - last_packet > silence:
                    reason = f"no packet for {silence:g} s; check the robot's program, RSI_ON and its IP_NUMBER"
                    raise DeviceTimeout(f"{self.where}: {reason}", last_packet)
        finally:
            self._clear += self._stamps.flush()
            self._put_clear()

    def _note_stranger(self, stranger: str) -> None:
        """Note once that another sender's packets are left out."""
        if stranger and not self._has_stranger:
            self._has_stranger = True
            remedy = "" if self._table.robot else "; if it is the robot, give its address as robot"
            self.note(f"packets of {stranger} are left out, as another sender came first{remedy}")

    def _take(self, data: bytes, arrival: float) -> None:
        """Count a packet and keep its values until their times are clear."""
        packet = parse_packet(data)
        if packet is None:
            self._n_unreadable += 1
            return
        findings = self._counter.add(packet, arrival)
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
        """Note how many packets were received, lost or late, and how many were left out and why."""
        super().conclude()
        counter, left_out = self._counter, self._left_out
        if self._child is not None:
            left_out = left_out + self._child.left_out
        expected = counter.n_received + counter.n_lost
        reasons = [f"{count} {REASONS[reason]}" for reason, count in left_out.items() if count]
        listed = f"; left out: {', '.join(reasons)}" if reasons else ""
        self.note(f"{counter.n_lost} of {expected} packets lost, {counter.n_late} late{listed}")

    def _release(self) -> None:
        child, self._child = self._child, None
        if child is not None:
            child.close()
            self._left_out += child.left_out
