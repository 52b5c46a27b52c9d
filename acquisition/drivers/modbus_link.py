"""The two ways to a Modbus drive: a serial line (RTU) and a network (TCP), through pymodbus."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Literal

from foundation import InputError

from ..errors import DeviceError, Disconnected, DriverMissing
from .serial_line import LINE_FAILURES

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
