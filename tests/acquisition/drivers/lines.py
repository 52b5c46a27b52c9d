"""Instruments at the other end of a serial line: pseudo terminals whose far end runs in a thread."""

import contextlib
import os
import socket
import struct
import threading
import time
import tty
from collections.abc import Callable


class FarEnd:
    """A pseudo terminal; ``serve(line)`` runs in a thread until `unplug`."""

    def __init__(self, serve: Callable[["FarEnd"], None]) -> None:
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.port = os.ttyname(slave)
        self._slave = slave
        self.unplugged = threading.Event()
        self.heard: list[bytes] = []
        self.settings: dict[str, float] = {}
        self._thread = threading.Thread(target=self._run, args=(serve,), daemon=True)
        self._thread.start()

    def _run(self, serve: Callable[["FarEnd"], None]) -> None:
        try:
            serve(self)
        except OSError:
            pass
        finally:
            os.close(self.master)

    def read(self) -> bytes:
        """What the computer sent; raises OSError when unplugged."""
        os.set_blocking(self.master, False)
        while not self.unplugged.is_set():
            try:
                return os.read(self.master, 256)
            except BlockingIOError:
                time.sleep(0.002)
        raise OSError("unplugged")

    def write(self, data: bytes) -> None:
        os.write(self.master, data)

    def unplug(self) -> None:
        if not self.unplugged.is_set():
            self.unplugged.set()
            os.close(self._slave)
        self._thread.join()


def amplifier(answers: dict[bytes, bytes]) -> Callable[[FarEnd], None]:
    """Answers commands by a table; what is not in it is answered with an error."""

    def serve(end: FarEnd) -> None:
        pending = b""
        while True:
            pending += end.read()
            *lines, pending = pending.split(b"\r\n")
            for line in lines:
                end.heard.append(line)
                answer = answers.get(line, b"ERR 5\r\n")
                for byte in answer:  # dribbles, as real lines do
                    end.write(bytes([byte]))

    return serve


def ranged_amplifier(ranges: dict[str, float]) -> Callable[[FarEnd], None]:
    """Keeps a range for each input: ``RANGE 1,500`` sets it, ``RANGE? 1`` asks for it."""

    def serve(end: FarEnd) -> None:
        end.settings.update(ranges)
        pending = b""
        while True:
            pending += end.read()
            *commands, pending = pending.split(b"\r\n")
            for command in commands:
                name, _, value = command.decode().partition(" ")
                if name == "RANGE":
                    number, _, wanted = value.partition(",")
                    end.settings[number] = float(wanted)
                    end.write(b"OK\r\n")
                else:
                    end.write(f"RANGE {end.settings[value]:.3e}\r\n".encode())

    return serve


def tachometer(line: Callable[[float], bytes], period: float) -> Callable[[FarEnd], None]:
    """Sends a line every ``period`` s; its argument is the host's monotonic time."""

    def serve(end: FarEnd) -> None:
        due = time.monotonic()
        while not end.unplugged.is_set():
            due += period
            time.sleep(max(0.0, due - time.monotonic()))
            end.write(line(time.monotonic()))

    return serve


def modbus_slave(address: int, registers: dict[int, int]) -> Callable[[FarEnd], None]:
    """Answers functions 3 and 4 for single registers, after the Modbus specification V1.1b3."""

    def serve(end: FarEnd) -> None:
        pending = b""
        while True:
            pending += end.read()
            if len(pending) < 8:
                continue
            request, pending = pending[:8], pending[8:]
            unit, function, register, count = struct.unpack(">BBHH", request[:6])
            assert request[6:] == checksum(request[:6])
            if unit != address:
                continue
            if register in registers and count == 1:
                body = struct.pack(">BBBH", unit, function, 2, registers[register])
            else:
                body = struct.pack(">BBB", unit, function | 0x80, 2)
            end.write(body + checksum(body))

    return serve


class TcpDrive:
    """A Modbus TCP drive on this machine, after MODBUS Messaging on TCP/IP V1.0b; `unplug` closes every socket."""

    def __init__(self, unit: int, registers: dict[int, int], port: int = 0) -> None:
        self._unit, self._registers = unit, registers
        self._server = socket.create_server(("127.0.0.1", port))
        self.port = int(self._server.getsockname()[1])
        self._sockets = [self._server]
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _serve(self) -> None:
        try:
            while True:
                line, _ = self._server.accept()
                self._sockets.append(line)
                while request := line.recv(12):
                    transaction, _, _, unit, function, register, count = struct.unpack(">HHHBBHH", request)
                    if unit != self._unit:
                        continue
                    if register in self._registers and count == 1:
                        body = struct.pack(">BBBH", unit, function, 2, self._registers[register])
                    else:
                        body = struct.pack(">BBB", unit, function | 0x80, 2)
                    line.sendall(struct.pack(">HHH", transaction, 0, len(body)) + body)
        except OSError:
            pass

    def unplug(self) -> None:
        for each in reversed(self._sockets):
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()
        self._thread.join()


def checksum(data: bytes) -> bytes:
    """CRC-16 of Modbus, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
    return struct.pack("<H", crc)
