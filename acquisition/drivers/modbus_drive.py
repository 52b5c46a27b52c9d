"""A spindle drive that is asked for its registers through Modbus-RTU."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import DeviceTimeout, Disconnected, DriverMissing
from ..sources.events import HOST_AXIS, Events
from ..sources.receiver import Put
from ..sources.threaded_feed import ThreadedFeed
from .serial_line import BITS_A_BYTE, LINE_FAILURES

_REPLY_BYTES = 7  # address, function, length, two data bytes, two of the checksum
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


class ModbusFeed(ThreadedFeed):
    """Registers of one slave, asked in turn.

    Parameters
    ----------
    port, baud
        Name and speed (bits/s) of the serial line.
    slave
        Address of the drive, 1 ... 247.
    registers
        Registers to read.
    interval : s
        Time between two rounds.
    timeout : s
        Time to wait for an answer; after five in a row without one the drive counts as lost.
    """

    def __init__(
        self,
        port: str,
        baud: int,
        slave: int,
        registers: Sequence[Register],
        *,
        interval: float = 0.1,
        timeout: float = 0.2,
    ) -> None:
        super().__init__(f"Modbus {port}", {register.series: HOST_AXIS for register in registers})
        self._port, self._baud, self._slave = port, baud, slave
        self._registers = tuple(registers)
        self._interval, self._timeout = interval, timeout
        self._drive: Any = None

    def _connect(self) -> None:
        try:
            import minimalmodbus
        except ImportError as error:
            raise DriverMissing(f"Modbus on {self._port}: needs minimalmodbus; pip install millfrf[devices]") from error
        try:
            self._drive = minimalmodbus.Instrument(self._port, self._slave)
        except OSError as error:
            raise Disconnected(f"serial line {self._port} cannot be opened: {error}; check its name") from error
        self._drive.serial.baudrate = self._baud
        self._drive.serial.timeout = self._timeout

    def _receive(self, put: Put, stopped: Callable[[], bool]) -> None:
        failures, due = 0, time.monotonic()
        while not stopped():
            for register in self._registers:
                value = self._ask(register)
                failures = failures + 1 if value is None else 0
                if failures >= _PATIENCE:
                    raise DeviceTimeout(
                        f"drive {self._slave} on {self._port} does not answer; check address, baud rate and register "
                        f"{register.address}"
                    )
                if value is not None:
                    sampled = time.monotonic() - _REPLY_BYTES * BITS_A_BYTE / self._baud
                    put(Events(register.series, np.array([sampled]), np.array([value * register.factor])))
            due = max(due + self._interval, time.monotonic())
            while not stopped() and (wait := due - time.monotonic()) > 0:
                time.sleep(min(wait, 0.1))

    def _ask(self, register: Register) -> float | None:
        """The register's integer, or None where no proper answer came."""
        import minimalmodbus

        try:
            function = 4 if register.input_register else 3
            return float(self._drive.read_register(register.address, functioncode=function, signed=register.signed))
        except minimalmodbus.ModbusException:
            return None
        except LINE_FAILURES as error:
            raise Disconnected(f"serial line {self._port} is gone ({error}); check its plug") from error

    def _release(self) -> None:
        if self._drive is not None:
            self._drive.serial.close()
            self._drive = None
