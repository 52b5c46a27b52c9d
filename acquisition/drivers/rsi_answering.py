"""Program that answers a KUKA controller in a separate process, so that a busy recorder never delays an answer.

The controller stops the robot if answers stay away. The file needs the standard library only and runs as
``python rsi_answering.py ADDRESS PORT ROBOT SENTYPE`` (ROBOT: the only address that is answered, or ``any``). Received
packets go to standard output as frames: host's monotonic time (ns), length, bytes. The first frame is empty and says
that the port is open. The program ends when its standard input is closed.
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

FRAME = struct.Struct("<QI")  # head of a frame: host's monotonic time in ns, number of bytes that follow
_IPOC = re.compile(rb"<IPOC>\s*(\d{1,20})\s*</IPOC>")


def answer(packet: bytes, sentype: str) -> bytes | None:
    """Return the answer to a packet: its time stamp (IPOC) and no correction, so that nothing can move the robot.

    Return None for a packet without a time stamp.
    """
    match = _IPOC.search(packet)
    if match is None:
        return None
    return b'<Sen Type="%s"><IPOC>%s</IPOC></Sen>' % (sentype.encode(), match[1])


def serve(address: str, port: int, robot: str, sentype: str) -> None:
    """Answer packets until the process ends.

    Frames are written by a thread, so that a full pipe delays no answer.
    """
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.bind((address, port))
    frames: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_write, args=(frames,), daemon=True).start()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    frames.put(FRAME.pack(time.monotonic_ns(), 0))
    while True:
        packet, sender = line.recvfrom(8192)
        arrival = time.monotonic_ns()
        if robot not in ("any", sender[0]):
            continue
        reply = answer(packet, sentype)
        if reply is not None:
            with suppress(OSError):  # the controller is gone; the recorder notices that no packet comes
                line.sendto(reply, sender)
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
