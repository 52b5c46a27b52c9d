"""A spindle drive whose registers are read through Modbus, on a serial line or a network."""

import logging
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from millfrf.core import InputError

from ..errors import DeviceError, DeviceTimeout, Disconnected, DriverMissing
from ..sources.receiving import Put, ThreadedFeed
from ..sources.source import HOST_AXIS, Events
from .serial_lines import LINE_FAILURES

Parity = Literal["none", "even", "odd"]
_REPLY_BYTES = 7  # address, function, length, two data bytes, two of the checksum


@dataclass(frozen=True)
class SerialLink:
    """Modbus-RTU on a serial line with eight data bits.

    Parameters
    ----------
    port, baud
        Name and speed (bits/s) of the serial line.
    parity
        ``none``, ``even`` (what the Modbus specification expects of every drive) or ``odd``.
    stop_bits
        1 or 2; the specification asks for 2 where there is no parity, most drives take 1.
    """

    port: str
    baud: int
    parity: Parity = "none"
    stop_bits: int = 1

    @property
    def where(self) -> str:
        """Name of the link in messages."""
        return f"Modbus {self.port}"

    @property
    def settings(self) -> str:
        """What must agree with the drive."""
        return f"baud rate {self.baud}, parity {self.parity}, {self.stop_bits} stop bits"

    @property
    def reply_duration(self) -> float:
        """Time that the answer of one register takes on the line, s."""
        return _REPLY_BYTES * (9 + (self.parity != "none") + self.stop_bits) / self.baud

    def client(self, timeout: float) -> Any:
        """An unopened pymodbus client; ``timeout`` in s is for one answer."""
        modbus = _pymodbus(self.where)
        letter = {"none": "N", "even": "E", "odd": "O"}[self.parity]
        return modbus.ModbusSerialClient(
            self.port, baudrate=self.baud, parity=letter, stopbits=self.stop_bits, timeout=timeout, retries=0
        )


@dataclass(frozen=True)
class TcpLink:
    """Modbus on a network (TCP), to the drive itself or to a gateway.

    Parameters
    ----------
    host
        Name or address of the drive or its gateway.
    port
        Number of the TCP port, 502 by the specification.
    """

    host: str
    port: int = 502

    @property
    def where(self) -> str:
        """Name of the link in messages."""
        return f"Modbus {self.host}:{self.port}"

    @property
    def settings(self) -> str:
        """What must agree with the drive."""
        return "network address and port"

    @property
    def reply_duration(self) -> float:
        """Time that the answer of one register takes on the network, s; too short to count."""
        return 0.0

    def client(self, timeout: float) -> Any:
        """An unopened pymodbus client; ``timeout`` in s is for one answer."""
        return _pymodbus(self.where).ModbusTcpClient(self.host, port=self.port, timeout=timeout, retries=0)


Link = SerialLink | TcpLink
_LOG = logging.getLogger("pymodbus.logging")


def connected(link: Link, timeout: float) -> Any:
    """A pymodbus client whose link is open.

    Raises
    ------
    DriverMissing, Disconnected
    """
    client = link.client(timeout)
    with _complaints() as said:
        there = client.connect()
    if not there:
        reason = f": {said[0]}" if said and not said[0].startswith("Repeating") else ""
        raise Disconnected(f"{link.where} cannot be opened{reason}; check its name, plug, power and settings")
    return client


@contextmanager
def _complaints() -> Iterator[list[str]]:
    """What pymodbus logs meanwhile: it tells the reason of a failure nowhere else."""
    said: list[str] = []
    handler = logging.Handler(logging.ERROR)
    handler.emit = lambda record: said.append(" ".join(record.getMessage().split()))  # type: ignore[method-assign]
    _LOG.addHandler(handler)
    try:
        yield said
    finally:
        _LOG.removeHandler(handler)


def ask(client: Any, link: Link, device: int, address: int, *, input_register: bool) -> int | None:
    """The register's integer (0 ... 65535), or None where no proper answer came.

    Raises
    ------
    InputError
        The drive answers that it has no such register.
    DeviceError, Disconnected
        The drive answers with another exception code, or the link is gone.
    """
    from pymodbus.exceptions import ConnectionException, ModbusException

    read = client.read_input_registers if input_register else client.read_holding_registers
    try:
        answer = read(address, count=1, device_id=device)
    except ConnectionException as error:
        raise Disconnected(f"{link.where} is gone; check its plug") from error
    except ModbusException:
        return None
    except LINE_FAILURES as error:
        raise Disconnected(f"{link.where} is gone ({error}); check its plug") from error
    if answer.isError():
        code = getattr(answer, "exception_code", 0)
        if code in (2, 3):  # illegal data address, illegal data value
            kind = "input" if input_register else "holding"
            raise InputError(f"{link.where}: drive {device} has no {kind} register {address}; see its manual")
        raise DeviceError(f"{link.where}: drive {device} answers register {address} with exception code {code}")
    return int(answer.registers[0])


def _pymodbus(where: str) -> Any:
    try:
        import pymodbus.client
        import serial  # noqa: F401  # pymodbus takes it only where it is loaded
    except ImportError as error:
        raise DriverMissing(f"{where}: needs pymodbus and pyserial; pip install millfrf[devices]") from error
    if not _LOG.handlers:
        _LOG.addHandler(logging.NullHandler())  # else its complaints come to the terminal beside this program's own
    return pymodbus.client


_PATIENCE = 5


@dataclass(frozen=True)
class Register:
    """One register of the drive as a series of events.

    Parameters
    ----------
    address
        Address of the register, counted from 0.
    series
        Name of its event series in the recording.
    factor
        Factor by which the integer is multiplied.
    signed
        Whether the integer is in two's complement.
    input_register
        Whether it is read with function 4 instead of 3 (holding register).
    """

    address: int
    series: str
    factor: float = 1.0
    signed: bool = False
    input_register: bool = False

    def value(self, integer: int) -> float:
        """The integer as a value."""
        return self.factor * (integer - 0x10000 if self.signed and integer >= 0x8000 else integer)


class ModbusFeed(ThreadedFeed):
    """Registers of one drive, asked in turn; every one is asked once before the recording begins.

    Parameters
    ----------
    link
        Serial line or network on which the drive is.
    slave
        Address of the drive, 1 ... 247; behind a gateway, that of the drive there.
    registers
        Registers to read.
    interval : s
        Time between two rounds.
    timeout : s
        Time to wait for an answer; after five in a row without one the drive counts as lost.
    """

    def __init__(
        self,
        link: Link,
        slave: int,
        registers: Sequence[Register],
        *,
        interval: float = 0.1,
        timeout: float = 0.2,
    ) -> None:
        super().__init__(link.where, {register.series: HOST_AXIS for register in registers})
        self._link, self._slave = link, slave
        self._registers = tuple(registers)
        self._interval, self._timeout = interval, timeout
        self._client: Any = None

    def _connect(self) -> None:
        self._client = connected(self._link, self._timeout)
        try:
            for register in self._registers:
                if all(self._ask(register) is None for _ in range(_PATIENCE)):
                    raise self._silent(register)
        except BaseException:
            self._release()
            raise

    def _receive(self, put: Put, stopped: Callable[[], bool]) -> None:
        failures, due = 0, time.monotonic()
        heard = due
        while not stopped():
            for register in self._registers:
                value = self._ask(register)
                failures = failures + 1 if value is None else 0
                if failures >= _PATIENCE:
                    raise self._silent(register, heard)
                if value is not None:
                    heard = time.monotonic()
                    put(Events(register.series, np.array([heard - self._link.reply_duration]), np.array([value])))
            due = max(due + self._interval, time.monotonic())
            while not stopped() and (wait := due - time.monotonic()) > 0:
                time.sleep(min(wait, 0.1))

    def _silent(self, register: Register, heard: float | None = None) -> DeviceTimeout:
        """The error of a drive that gives no answer."""
        return DeviceTimeout(
            f"{self.where}: drive {self._slave} does not answer; check its address, {self._link.settings} and register "
            f"{register.address}",
            heard,
        )

    def _ask(self, register: Register) -> float | None:
        """The register's value, or None where no proper answer came."""
        found = ask(self._client, self._link, self._slave, register.address, input_register=register.input_register)
        return None if found is None else register.value(found)

    def _release(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
