"""Packets of a KUKA controller, and the count of those that were lost or late."""

from collections import Counter
from dataclasses import dataclass
from xml.etree import ElementTree

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
