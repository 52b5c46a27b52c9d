"""Program that answers a KUKA controller in a separate process, so that a busy recorder never delays an answer.

The controller stops the robot if answers stay away. The file needs the standard library only and runs as
``python rsi_answering.py ADDRESS PORT ROBOT SENTYPE SILENCE`` (ROBOT: the only address that is answered, or ``any``;
SILENCE: see `Gate`). Packets that the gate admits go to standard output as frames: host's monotonic time (ns), number
of bytes, kind, bytes. The first frame is empty and says that the port is open. The program ends when its standard input
is closed.
"""

import json
import os
import queue
import re
import socket
import struct
import sys
import threading
import time
from contextlib import suppress

FRAME = struct.Struct("<QIB")  # head of a frame: host's monotonic time in ns, number of bytes that follow, kind
PACKET, COUNTS = 0, 1  # kinds: a packet of the controller; the counts of `Gate` as JSON
DRIFT = 200e-6  # relative; largest drift of the controller's clock
_SETTLING = 1.0  # s after the first packet in which the offset of the clocks is learnt
_EARLIEST = 0.1  # s before its time at which a packet is still admitted: lateness of the first packets
_STRANGERS = 1000  # senders that are remembered; a sender with more ports than this is no robot
_WAITING = 2000  # frames that wait for the recorder: 8 s of the fastest cycle
_REPORT = 0.1  # s between two reports of the counts
_IPOC = re.compile(rb"<IPOC>\s*(\d{1,18})\s*</IPOC>")

Sender = tuple[str, int]


def time_stamp(packet: bytes) -> int | None:
    """Return the time stamp of a packet (IPOC), ms; None if it has none."""
    match = _IPOC.search(packet)
    return None if match is None else int(match[1])


def answer(packet: bytes, sentype: str) -> bytes | None:
    """Return the answer to a packet: its time stamp (IPOC) and no correction, so that nothing can move the robot.

    Return None for a packet without a time stamp.
    """
    ipoc = time_stamp(packet)
    return None if ipoc is None else b'<Sen Type="%s"><IPOC>%d</IPOC></Sen>' % (sentype.encode(), ipoc)


class Gate:
    """Admits the packets of one sender in the order of their time stamps, and counts all others.

    The sender is the first one; with ``robot`` it must have that network address. Its port may change after
    ``silence`` (s) without an admitted packet, but not to that of a sender that was heard together with it. The clock
    of the controller runs as fast as the host's: a packet that is stamped later than this allows is forged, and one
    that is not stamped later than the last is forged or was overtaken. After ``silence`` any time stamp is admitted, as
    the controller may have been restarted.
    """

    def __init__(self, robot: str, silence: float) -> None:
        self._silence = silence
        self._sender: Sender | None = None
        self._robot = None if robot == "any" else robot
        self._last_arrival, self._last_ipoc = -float("inf"), 0
        self._started, self._first_lateness, self._least_lateness = 0.0, 0.0, 0.0
        self.counts: dict[str, int] = {"foreign": 0, "overtaken": 0, "early": 0, "unreadable": 0, "busy": 0}
        self._strangers: set[Sender] = set()
        self.stranger = ""  # last sender that is not believed

    def believes(self, sender: Sender, arrival: float) -> bool:
        """Return whether packets of a sender are looked at and answered; count the packet if not."""
        if sender == self._sender:
            return True
        is_silent = arrival - self._last_arrival > self._silence
        if is_silent and self._robot in (None, sender[0]) and sender not in self._strangers:
            return len(self._strangers) < _STRANGERS
        self.counts["foreign"] += 1
        if len(self._strangers) < _STRANGERS:
            self._strangers.add(sender)
        self.stranger = f"{sender[0]}:{sender[1]}"
        return False

    def admits(self, ipoc: int | None, sender: Sender, arrival: float) -> bool:
        """Return whether a packet of a believed sender is recorded; count it if not."""
        if ipoc is None:
            self.counts["unreadable"] += 1
            return False
        lateness = arrival - 1e-3 * ipoc
        if arrival - self._last_arrival > self._silence:
            self._sender, self._robot = sender, sender[0]
            self._started, self._first_lateness, self._least_lateness = arrival, lateness, lateness
        elif ipoc <= self._last_ipoc:
            self.counts["overtaken"] += 1
            return False
        elif lateness < self._earliest(arrival - self._started):
            self.counts["early"] += 1
            return False
        if arrival - self._started < _SETTLING:
            self._least_lateness = min(self._least_lateness, lateness)
        self._last_arrival, self._last_ipoc = arrival, ipoc
        return True

    def _earliest(self, duration: float) -> float:
        """Return the least lateness of an honest packet, s, after the clocks have run for ``duration``."""
        if duration < _SETTLING:
            return self._first_lateness - self._silence
        return self._least_lateness - _EARLIEST - DRIFT * duration

    def report(self) -> bytes:
        """Return the counts as JSON, with the last sender that is not believed."""
        return json.dumps({**self.counts, "stranger": self.stranger}).encode()


class _Frames:
    """Frames that a thread writes to standard output, so that a full pipe delays no answer."""

    def __init__(self) -> None:
        self._waiting: queue.Queue[bytes] = queue.Queue(_WAITING)
        threading.Thread(target=self._write, daemon=True).start()

    def put(self, arrival: int, data: bytes, kind: int = PACKET) -> bool:
        """Add a frame; return False if too many wait for the recorder."""
        try:
            self._waiting.put_nowait(FRAME.pack(arrival, len(data), kind) + data)
        except queue.Full:
            return False
        return True

    def _write(self) -> None:
        try:
            while True:
                sys.stdout.buffer.write(self._waiting.get())
                if self._waiting.empty():
                    sys.stdout.buffer.flush()
        except OSError:
            os._exit(0)


def serve(address: str, port: int, robot: str, sentype: str, silence: float) -> None:
    """Answer packets until the process ends."""
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)  # room for the robot's packets in a flood
    line.bind((address, port))
    line.settimeout(_REPORT)
    frames, gate = _Frames(), Gate(robot, silence)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    frames.put(time.monotonic_ns(), b"")
    reported, next_report = gate.report(), time.monotonic() + _REPORT
    while True:
        try:
            packet, sender = line.recvfrom(8192)
        except TimeoutError:
            packet = b""
        arrival = time.monotonic_ns()
        if packet and gate.believes(sender, 1e-9 * arrival):
            _take(packet, sender, arrival, line, sentype, gate, frames)
        if 1e-9 * arrival > next_report:
            next_report = 1e-9 * arrival + _REPORT
            if (report := gate.report()) != reported and frames.put(arrival, report, COUNTS):
                reported = report


def _take(
    packet: bytes, sender: Sender, arrival: int, line: socket.socket, sentype: str, gate: Gate, frames: _Frames
) -> None:
    """Answer a packet of the believed sender, and pass it on if it is admitted."""
    reply = answer(packet, sentype)
    if reply is not None:
        with suppress(OSError):  # the controller is gone; the recorder notices that no packet comes
            line.sendto(reply, sender)
    if gate.admits(time_stamp(packet), sender, 1e-9 * arrival) and not frames.put(arrival, packet):
        gate.counts["busy"] += 1


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    try:
        serve(sys.argv[1], int(sys.argv[2]), sys.argv[3], sys.argv[4], float(sys.argv[5]))
    except OSError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(1)
    except KeyboardInterrupt:
        pass
