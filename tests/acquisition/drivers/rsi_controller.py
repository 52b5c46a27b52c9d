"""A simulated KUKA controller, a process of its own: sends an RSI packet every cycle and waits for its echo.

Arguments: port, cycle in ms, number of packets, then ``lose=5,6,30`` (never sent), ``late=50,51`` (sent 3 cycles late,
after their successors), ``first=IPOC``. A1 is 10 degrees times the packet's number, X the host's monotonic time in mm
when the packet was due. At its end it prints as JSON how many answers came, how many of them were wrong (not the echo
of a packet that waits for its answer), and the median time to an answer, ms.
"""

import json
import math
import re
import socket
import statistics
import sys
import time

PACKET = (
    '<Rob Type="KUKA"><RIst X="{x:.4f}" Y="0.0" Z="1500.0" A="0.0" B="90.0" C="-180.0"/>'
    '<AIPos A1="{a1:.4f}" A2="-90.0" A3="90.0" A4="0.0" A5="45.0" A6="0.0"/>'
    '<MACur A1="{current:.4f}" A2="0.5" A3="0.5" A4="0.1" A5="0.1" A6="0.1"/>'
    '<Delay D="{delay}"/><IPOC>{ipoc}</IPOC></Rob>'
)


def main(port: int, cycle: int, n_packets: int, lose: set[int], late: set[int], first: int) -> dict[str, float]:
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.connect(("127.0.0.1", port))
    stated = {"sent": 0, "answered": 0, "wrong": 0, "delay": 0}
    unanswered: dict[int, float] = {}
    delays: list[float] = []
    waiting: list[tuple[int, bytes]] = []
    started = time.monotonic()
    for k in range(n_packets):
        due = started + 1e-3 * cycle * k
        _listen(line, due, stated, unanswered, delays)
        fields = {
            "x": 1e3 * due,
            "a1": 10.0 * k,
            "current": 0.01 * k,
            "delay": stated["delay"],
            "ipoc": first + cycle * k,
        }
        packet = PACKET.format(**fields).encode()
        if k in late:
            waiting.append((k + 3, packet))
        elif k not in lose:
            _send(line, packet, stated, unanswered)
        for entry in [entry for entry in waiting if entry[0] <= k]:
            waiting.remove(entry)
            _send(line, entry[1], stated, unanswered)
    _listen(line, time.monotonic() + 0.2, stated, unanswered, delays)
    return {**stated, "median_delay_ms": 1e3 * statistics.median(delays or [math.inf])}


def _send(line: socket.socket, packet: bytes, told: dict[str, int], unanswered: dict[int, float]) -> None:
    try:
        line.send(packet)
        told["sent"] += 1
        unanswered[int(packet.rpartition(b"<IPOC>")[2].partition(b"<")[0])] = time.monotonic()
    except ConnectionRefusedError:
        told["delay"] += 1


def _listen(
    line: socket.socket, due: float, told: dict[str, int], unanswered: dict[int, float], delays: list[float]
) -> None:
    """Take answers until the next packet is due."""
    while (left := due - time.monotonic()) > 0:
        line.settimeout(left)
        try:
            answer = line.recv(4096).decode()
        except (TimeoutError, ConnectionRefusedError):
            continue
        result = re.fullmatch(r'<Sen Type="ImFree"><IPOC>(\d+)</IPOC></Sen>', answer)
        told["answered"] += 1
        if result is None or int(result[1]) not in unanswered:
            told["wrong"] += 1
        else:
            delays.append(time.monotonic() - unanswered.pop(int(result[1])))


if __name__ == "__main__":
    port, cycle, n_packets = map(int, sys.argv[1:4])
    given = dict(text.split("=") for text in sys.argv[4:])
    numbers = {name: {int(k) for k in given.get(name, "").split(",") if k} for name in ("lose", "late")}
    print(
        json.dumps(
            main(port, cycle, n_packets, numbers["lose"], numbers["late"], int(given.get("first", "4208163634")))
        )
    )
