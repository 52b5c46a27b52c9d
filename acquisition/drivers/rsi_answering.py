"""Answers a robot controller in a process of its own, so that a busy recorder never lets the robot wait.

The controller stops its program when answers stay away. This file needs the standard library only and is run as a
script: ``python rsi_answering.py ADDRESS PORT ROBOT SENTYPE`` (ROBOT: the only address that is heard, or ``any``). What
comes goes to standard output as frames: host's monotonic time (ns), length, bytes; the first frame is empty and says
that the port is open. It ends when its standard input is closed.
"""

import os
import queue
import re
import socket
import struct
import sys
import threading
import time
from contextlib import suppress

FRAME = struct.Struct("<QI")
"""Head of a frame: host's monotonic time in ns, and the number of bytes that follow."""

LARGEST = 8192
_IPOC = re.compile(rb"<IPOC>\s*(\d{1,20})\s*</IPOC>")


def answer(packet: bytes, sentype: str) -> bytes | None:
    """The answer to a packet: its IPOC and no correction, so that nothing can move the robot; None: not understood."""
    found = _IPOC.search(packet)
    if found is None:
        return None
    return b'<Sen Type="%s"><IPOC>%s</IPOC></Sen>' % (sentype.encode(), found[1])


def serve(address: str, port: int, robot: str, sentype: str) -> None:
    """Answer until the process ends; writing waits in a thread, answering never."""
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.bind((address, port))
    frames: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_write, args=(frames,), daemon=True).start()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    frames.put(FRAME.pack(time.monotonic_ns(), 0))
    while True:
        packet, sender = line.recvfrom(LARGEST)
        arrival = time.monotonic_ns()
        if robot not in ("any", sender[0]):
            continue
        said = answer(packet, sentype)
        if said is not None:
            with suppress(OSError):  # the controller's end is gone; the recorder notices that nothing comes
                line.sendto(said, sender)
        frames.put(FRAME.pack(arrival, len(packet)) + packet)


def _write(frames: "queue.SimpleQueue[bytes]") -> None:
    try:
        while True:
            sys.stdout.buffer.write(frames.get())
            if frames.empty():
                sys.stdout.buffer.flush()
    except OSError:
        os._exit(0)


def _end_with_parent() -> None:
    sys.stdin.buffer.read()
    os._exit(0)


if __name__ == "__main__":
    try:
        serve(sys.argv[1], int(sys.argv[2]), sys.argv[3], sys.argv[4])
    except OSError as error:
        sys.stderr.write(f"{error}\n")
        sys.exit(1)
    except KeyboardInterrupt:
        pass
