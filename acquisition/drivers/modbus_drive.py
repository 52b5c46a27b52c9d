"""A spindle drive that is asked for its registers through Modbus, on a serial line or a network."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import DeviceTimeout
from ..sources import HOST_AXIS, Events, Put, ThreadedFeed
from .modbus_link import Link, ask, connected

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
