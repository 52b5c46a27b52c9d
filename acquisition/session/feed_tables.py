"""`[[can]]`, `[[tachometer]]`, `[[modbus]]`, `[[rsi]]` and `[[amplifier]]` of a session."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, model_validator

from ..drivers.amplifier import Amplifier, Command
from ..drivers.can_bus import CanFeed, CanSignal
from ..drivers.modbus import ModbusFeed, Register, SerialLink, TcpLink
from ..drivers.rsi import STANDARD_SIGNALS, RsiFeed, RsiSignal
from ..drivers.serial_lines import TachometerFeed
from .channel_table import STRICT, Name, Positive

Baud = Annotated[int, Field(ge=50, le=10_000_000)]


class SignalTable(BaseModel):
    """One signal of a DBC file; see `CanSignal`.

    Parameters
    ----------
    signal
        Name in the DBC file: ``Speed``, or ``Message.Speed`` where several messages have a signal of that name.
    series
        Name of the event series in the recording; empty: the same.
    factor
        Factor to SI units; to rpm for the series ``spindle_speed_rpm``, which ``chatter`` reads.
    """

    model_config = STRICT
    signal: Name
    series: str = ""
    factor: float = 1.0


class RsiSignalTable(BaseModel):
    """One value of a KUKA controller's packets; see `RsiSignal`.

    Parameters
    ----------
    signal
        Element and attribute of the controller's packet, such as ``AIPos.A1``.
    series
        Name of the event series in the recording.
    factor
        Factor to SI units.
    """

    model_config = STRICT
    signal: Annotated[str, Field(pattern=r"^\w+\.\w+$")]
    series: Name
    factor: float = 1.0


class CanTable(BaseModel):
    """A CAN bus; see `CanFeed`. ``dbc`` is looked for beside the session file.

    Parameters
    ----------
    interface
        Interface in the words of python-can, such as ``socketcan`` or ``pcan``.
    channel
        Channel of that interface, such as ``can0`` or ``PCAN_USBBUS1``.
    dbc
        DBC file of the bus, from the folder of the session file.
    signals
        Signals to keep.
    silence_s : s
        Time without a wanted message after which the bus counts as lost.
    options
        Further arguments of the interface, such as ``bitrate``.
    """

    model_config = STRICT
    interface: Name
    channel: Name
    dbc: Name
    signals: Annotated[tuple[SignalTable, ...], Field(min_length=1)]
    silence_s: Positive = 2.0
    options: dict[str, Any] = Field(default_factory=dict)

    def feed(self, folder: Path) -> CanFeed:
        """The bus as a feed."""
        signals = [CanSignal(each.signal, each.series, each.factor) for each in self.signals]
        path = folder / self.dbc
        return CanFeed(self.interface, self.channel, path, signals, silence=self.silence_s, options=self.options)


class TachometerTable(BaseModel):
    """An instrument that sends a number a line; see `TachometerFeed`.

    Parameters
    ----------
    port
        Serial line, ``COM3`` or ``/dev/ttyUSB0``.
    baud : bit/s
        Speed of the line.
    series
        Name of the event series in the recording.
    pattern
        Regular expression whose first group is the number; left out: the first number of the line.
    factor
        Factor to SI units; to rpm for the series ``spindle_speed_rpm``, which ``chatter`` reads.
    period_s : s
        Time between two lines where the instrument keeps it exactly; left out: the times of arrival count.
    silence_s : s
        Time without a line after which the instrument counts as lost.
    """

    model_config = STRICT
    port: Name
    baud: Baud
    series: Name
    pattern: str | None = None
    factor: float = 1.0
    period_s: Positive | None = None
    silence_s: Positive = 3.0

    def feed(self, folder: Path) -> TachometerFeed:
        """The line as a feed."""
        del folder
        chosen = {} if self.pattern is None else {"pattern": self.pattern}
        return TachometerFeed(
            self.port,
            self.baud,
            self.series,
            factor=self.factor,
            period=self.period_s,
            silence=self.silence_s,
            **chosen,
        )


class RegisterTable(BaseModel):
    """One register; see `Register`.

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
        Whether it is read with function 4 instead of 3.
    """

    model_config = STRICT
    address: Annotated[int, Field(ge=0, le=65535)]
    series: Name
    factor: float = 1.0
    signed: bool = False
    input_register: bool = False


class ModbusTable(BaseModel):
    """A drive; see `ModbusFeed`. On a serial line it has ``port`` and ``baud``, on a network ``host``.

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
        Its TCP port.
    slave
        Address of the drive.
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
    def _one_link(self) -> "ModbusTable":
        if bool(self.port) == bool(self.host):
            raise ValueError("modbus: give either port and baud (a serial line) or host (Modbus TCP)")
        if self.port and self.baud is None:
            raise ValueError(f"modbus on {self.port}: baud is missing; take it from the drive's settings")
        return self

    def feed(self, folder: Path) -> ModbusFeed:
        """The drive as a feed."""
        del folder
        link: SerialLink | TcpLink = TcpLink(self.host, self.tcp_port)
        if self.baud is not None:
            link = SerialLink(self.port, self.baud, self.parity, self.stop_bits)
        registers = [Register(**each.model_dump()) for each in self.registers]
        return ModbusFeed(link, self.slave, registers, interval=self.interval_s, timeout=self.timeout_s)


class RsiTable(BaseModel):
    """A KUKA robot; see `RsiFeed`. Without ``signals``: joint angles, position and motor currents.

    Parameters
    ----------
    address
        Network address of this computer in the robot's network.
    port
        UDP port that the controller sends to.
    robot
        Network address of the controller; others are not heard. Empty: any.
    signals
        Values to keep; empty: joint angles, position and motor currents.
    cycle_ms : ms
        Time between two packets; left out: the packets tell.
    silence_s : s
        Time without a packet after which the controller counts as lost.
    sentype
        Name that the controller's configuration expects in the answers (SENTYPE).
    """

    model_config = STRICT
    address: Name
    port: Annotated[int, Field(ge=1, le=65535)] = 59152
    robot: str = ""
    signals: tuple[RsiSignalTable, ...] = ()
    cycle_ms: Literal[4, 12] | None = None
    silence_s: Positive = 1.0
    sentype: Annotated[str, Field(pattern=r"^\w+$")] = "ImFree"

    def feed(self, folder: Path) -> RsiFeed:
        """The robot as a feed."""
        del folder
        signals = [RsiSignal(each.signal, each.series, each.factor) for each in self.signals] or STANDARD_SIGNALS
        return RsiFeed(
            self.address,
            self.port,
            self.robot,
            signals,
            cycle=self.cycle_ms,
            silence=self.silence_s,
            sentype=self.sentype,
        )


class CommandTable(BaseModel):
    """One command; see `Command`.

    Parameters
    ----------
    send
        Text to send; ``{fx}`` stands for the range of channel fx.
    expect
        Regular expression that the answer must match from its beginning, ``{fx}`` for a range as in ``send``; empty:
        no answer is awaited.
    wait_s : s
        Time to wait for the answer, or after a command without one.
    """

    model_config = STRICT
    send: Name
    expect: str = ""
    wait_s: Positive = 1.0

    def command(self) -> Command:
        """As the driver takes it."""
        return Command(self.send, self.expect, self.wait_s)


class AmplifierTable(BaseModel):
    """A charge amplifier; see `Amplifier`. Channels name it by ``name``, or by its port where it has none.

    Parameters
    ----------
    name
        Name by which channels refer to it; empty: its port.
    port
        Serial line of the amplifier.
    baud : bit/s
        Speed of the line.
    ending
        Characters at the end of each command.
    on_open
        Commands when the recording begins; they are not sent again where the line was lost.
    on_close
        Commands when the recording ends.
    check
        Questions with the answers that must come.
    check_every_s : s
        Time between two rounds of questions.
    """

    model_config = STRICT
    name: str = ""
    port: Name
    baud: Baud
    ending: str = "\r\n"
    on_open: tuple[CommandTable, ...] = ()
    on_close: tuple[CommandTable, ...] = ()
    check: tuple[CommandTable, ...] = ()
    check_every_s: Positive = 5.0

    @property
    def called(self) -> str:
        """Its name, or its port."""
        return self.name or self.port

    def ranges_told(self) -> frozenset[str]:
        """Channels whose range its commands send or expect."""
        commands = [each.command() for each in (*self.on_open, *self.check)]
        return frozenset(name for command in commands for name in command.ranges if not name.isdigit())

    def feed(self, folder: Path, ranges: Mapping[str, float] | None = None) -> Amplifier:
        """The amplifier as a feed without events; ``ranges`` by channel name."""
        del folder
        opening, closing, check = (
            [each.command() for each in commands] for commands in (self.on_open, self.on_close, self.check)
        )
        return Amplifier(
            self.port,
            self.baud,
            opening,
            closing,
            self.ending,
            check=check,
            check_every=self.check_every_s,
            ranges=ranges,
        )
