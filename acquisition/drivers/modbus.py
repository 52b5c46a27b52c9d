"""A spindle drive whose registers are read through Modbus, on a serial line or a network."""

import logging
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field, model_validator

from millfrf.core import InputError

from ..channels import STRICT, Name, Positive
from ..settings import SETTINGS
from ..sources.source import HOST_AXIS, DeviceError, DeviceTimeout, Disconnected, DriverMissing, Events
from ..sources.threaded_feed import ThreadedFeed
from .serial_lines import LINE_FAILURES, Baud

_LOG = logging.getLogger("pymodbus.logging")


def _pymodbus(where: str) -> Any:
    try:
        import pymodbus.client  # optional: the extra `devices`
        import serial  # noqa: F401  # pymodbus uses it only if it is loaded
    except ImportError as error:
        raise DriverMissing(f"{where}: needs pymodbus and pyserial; pip install millfrf[devices]") from error
    _LOG.propagate = False  # else its messages appear on the terminal; those that matter become errors and counts
    return pymodbus.client


@contextmanager
def _logged_errors() -> Iterator[list[str]]:
    """Collect the errors that pymodbus logs in this thread, because it reports the reason of a failure nowhere else."""
    errors: list[str] = []
    handler, thread = logging.Handler(logging.ERROR), threading.get_ident()

    def keep(record: logging.LogRecord) -> None:
        if record.thread == thread:
            errors.append(" ".join(record.getMessage().split()))

    handler.emit = keep  # type: ignore[method-assign]
    _LOG.addHandler(handler)
    try:
        yield errors
    finally:
        _LOG.removeHandler(handler)


class RegisterTable(BaseModel):
    """One register of a drive.

    Parameters
    ----------
    address
        Address of the register, counted from 0.
    series
        Name of the event series in the recording.
    factor
        Factor from the integer to SI units; to rpm for the series ``spindle_speed_rpm``, which ``chatter`` reads.
    signed
        Whether the integer is in two's complement.
    input_register
        Whether it is read with function 4 (input register) instead of 3 (holding register).
    """

    model_config = STRICT
    address: Annotated[int, Field(ge=0, le=65535)]
    series: Name
    factor: float = 1.0
    signed: bool = False
    input_register: bool = False

    def value(self, integer: int) -> float:
        """Convert the integer of the register to the value of the series."""
        return self.factor * (integer - 0x10000 if self.signed and integer >= 0x8000 else integer)


class ModbusTable(BaseModel):
    """A drive. On a serial line it has ``port`` and ``baud``, on a network ``host``.

    Parameters
    ----------
    port
        Serial line of the drive; or instead ``host``.
    baud : bit/s
        Speed of the serial line.
    parity
        Parity of the serial line, as the drive is set.
    stop_bits
        Number of stop bits of the serial line.
    host
        Network address of the drive or gateway.
    tcp_port
        TCP port of the drive or gateway.
    slave
        Address of the drive; behind a gateway, that of the drive there.
    registers
        Registers to read.
    interval_s : s
        Time between two rounds.
    timeout_s : s
        Time to wait for an answer; after five in a row without one the drive counts as lost.
    """

    model_config = STRICT
    port: str = ""
    baud: Baud | None = None
    parity: Literal["none", "even", "odd"] = "none"
    stop_bits: Literal[1, 2] = 1
    host: str = ""
    tcp_port: Annotated[int, Field(ge=1, le=65535)] = 502
    slave: Annotated[int, Field(ge=1, le=247)]
    registers: Annotated[tuple[RegisterTable, ...], Field(min_length=1)]
    interval_s: Positive = 0.1
    timeout_s: Positive = 0.2

    @model_validator(mode="after")
    def _has_one_link(self) -> "ModbusTable":
        if bool(self.port) == bool(self.host):
            raise ValueError("modbus: give either port and baud (a serial line) or host (Modbus TCP)")
        if self.port and self.baud is None:
            raise ValueError(f"modbus on {self.port}: baud is missing; take it from the drive's settings")
        return self

    @property
    def where(self) -> str:
        """Return the name of the line or of the network address for messages."""
        return f"Modbus {self.port}" if self.port else f"Modbus {self.host}:{self.tcp_port}"

    @property
    def link_settings(self) -> str:
        """Return the settings that must agree with those of the drive, for messages."""
        if self.host:
            return "network address and port"
        return f"baud rate {self.baud}, parity {self.parity}, {self.stop_bits} stop bits"

    @property
    def reply_duration(self) -> float:
        """Return the time that the answer of one register takes on the serial line, s; 0 on a network."""
        if self.host or self.baud is None:
            return 0.0
        reply_bytes = 7  # address, function, length, two data bytes, two of the checksum
        bits_per_byte = 9 + (self.parity != "none") + self.stop_bits  # a start bit, eight data bits
        return reply_bytes * bits_per_byte / self.baud

    def client(self) -> Any:
        client = _pymodbus(self.where)
        if self.host:
            return client.ModbusTcpClient(self.host, port=self.tcp_port, timeout=self.timeout_s, retries=0)
        letter = {"none": "N", "even": "E", "odd": "O"}[self.parity]
        return client.ModbusSerialClient(
            self.port,
            baudrate=self.baud,
            parity=letter,
            stopbits=self.stop_bits,
            timeout=self.timeout_s,
            retries=0,
        )


class ModbusFeed(ThreadedFeed):
    """Registers of one drive, read in turn; each register is read once before the recording begins."""

    def __init__(self, table: ModbusTable) -> None:
        super().__init__(table.where, {register.series: HOST_AXIS for register in table.registers})
        self._table = table
        self._client: Any = None

    def _connect(self) -> None:
        self._client = self._table.client()
        try:
            with _logged_errors() as errors:
                connected = self._client.connect()
            if not connected:
                reason = f": {errors[0]}" if errors and not errors[0].startswith("Repeating") else ""
                raise Disconnected(f"{self.where} cannot be opened{reason}; check its name, plug, power and settings")
            for register in self._table.registers:
                if all(self._read(register) is None for _ in range(SETTINGS.modbus_attempts)):
                    raise self._timeout(register)
        except BaseException:
            self._release()
            raise

    def _receive(self) -> None:
        failures, due = 0, time.monotonic()
        last_answer = due
        while not self._stopped.is_set():
            for register in self._table.registers:
                if self._stopped.is_set():
                    return
                with _logged_errors() as errors:
                    value = self._read(register)
                failures = failures + 1 if value is None else 0
                self._n_unreadable += sum("Skipping" in error for error in errors)  # answers to no request of ours
                if failures >= SETTINGS.modbus_attempts:
                    raise self._timeout(register, last_answer)
                if value is not None:
                    last_answer = time.monotonic()
                    times = np.array([last_answer - self._table.reply_duration])
                    self._put([Events(register.series, times, np.array([value]))])
            due = max(due + self._table.interval_s, time.monotonic())
            self._stopped.wait(due - time.monotonic())

    def _timeout(self, register: RegisterTable, last_answer: float | None = None) -> DeviceTimeout:
        return DeviceTimeout(
            f"{self.where}: drive {self._table.slave} does not answer; check its address, "
            f"{self._table.link_settings} and register {register.address}",
            last_answer,
        )

    def _read(self, register: RegisterTable) -> float | None:
        """Read the value of a register; return None if no proper answer came."""
        from pymodbus.exceptions import ConnectionException, ModbusException  # optional, as in `_pymodbus`

        where, address, drive = self.where, register.address, self._table.slave
        client = self._client
        read = client.read_input_registers if register.input_register else client.read_holding_registers
        try:
            answer = read(address, count=1, device_id=drive)
        except ConnectionException as error:
            raise Disconnected(f"{where} is gone; check its plug") from error
        except ModbusException:
            return None
        except LINE_FAILURES as error:
            raise Disconnected(f"{where} is gone ({error}); check its plug") from error
        if answer.isError():
            code = getattr(answer, "exception_code", 0)
            if code in (2, 3):  # illegal data address, illegal data value
                kind = "input" if register.input_register else "holding"
                raise InputError(f"{where}: drive {drive} has no {kind} register {address}; see its manual")
            raise DeviceError(f"{where}: drive {drive} answers register {address} with exception code {code}")
        return register.value(int(answer.registers[0]))

    def _release(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
