"""A device that floods: 15 000 messages a second, or as many as the line takes; a process of its own.

Arguments: kind (``can``, ``line``: a pseudo terminal behind the link PLACE; ``modbus``: a TCP server on port PLACE;
``rsi``: forged packets to the UDP port PLACE), place, and for ``rsi`` the address of the sender and a duration in s,
after which it prints the number of packets. It floods as soon as it is read, until it is ended.
"""

import contextlib
import os
import socket
import struct
import sys
import time
import tty
from collections.abc import Callable
from pathlib import Path

RATE = 15_000
MESSAGES = {
    "can": b"t1008" + (2 * 6000).to_bytes(2, "little").hex().encode() + bytes(6).hex().encode() + b"\r",
    "line": b"6001.5\r\n",
    "modbus": struct.pack(">HHHBBBH", 65001, 0, 5, 3, 3, 2, 41),  # answers to a request that was never made
}


def flood(write: Callable[[bytes], object], message: bytes) -> None:
    started, sent = time.monotonic(), 0
    while True:
        due = int(RATE * (time.monotonic() - started)) - sent
        sent += due
        write(message * min(due, 500))  # what could not be written for long, as nobody read, is not made up for
        time.sleep(0.002)


def flood_line(message: bytes, place: str) -> None:
    master, slave = os.openpty()
    tty.setraw(slave)
    Path(place).symlink_to(os.ttyname(slave))
    flood(lambda data: os.write(master, data), message)


def flood_client(message: bytes, port: int) -> None:
    """Answer the requests of a client, each amid a flood of other answers."""
    server = socket.create_server(("127.0.0.1", port))
    while True:
        client, _ = server.accept()
        client.setblocking(False)
        try:
            flood(lambda data, client=client: answer(client, data), message)  # type: ignore[misc]
        except OSError:
            client.close()


def answer(client: socket.socket, data: bytes) -> None:
    try:
        request = client.recv(12)
    except BlockingIOError:
        request = b""
    if len(request) == 12:
        data = request[:2] + struct.pack(">HHBBBH", 0, 5, 3, 3, 2, 42) + data
    try:
        client.sendall(data)
    except BlockingIOError:  # the client does not read so fast
        time.sleep(0.01)


def flood_robot(port: int, sender: str, duration: float) -> int:
    """Send packets of another robot, with time stamps that repeat."""
    line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    line.bind((sender, 0))
    line.connect(("127.0.0.1", port))
    started, sent = time.monotonic(), 0
    while (elapsed := time.monotonic() - started) < duration:
        for _ in range(int(RATE * elapsed) - sent):
            packet = f'<Rob Type="KUKA"><AIPos A1="0.0" A2="0.0"/><IPOC>{4208163634 + sent % 5000}</IPOC></Rob>'
            with contextlib.suppress(ConnectionRefusedError):  # nobody listens yet, or any more
                line.send(packet.encode())
            sent += 1
        time.sleep(0.001)
    return sent


if __name__ == "__main__":
    kind, place, *details = sys.argv[1:]
    if kind == "rsi":
        print(flood_robot(int(place), details[0], float(details[1])))
    elif kind == "modbus":
        flood_client(MESSAGES[kind], int(place))
    else:
        flood_line(MESSAGES[kind], place)
