from .amplifier import Amplifier, Command
from .can_bus import CanFeed, CanSignal, DbcDecoder
from .modbus_drive import ModbusFeed, Register
from .modbus_link import SerialLink, TcpLink
from .ni import NiClocks, NiCounter, NiInput, NiSource
from .replay import ReplaySource
from .rsi import RSI_COUNTS, STANDARD_SIGNALS, RsiFeed, RsiSignal
from .tachometer_line import TachometerFeed

__all__ = [
    "RSI_COUNTS",
    "STANDARD_SIGNALS",
    "Amplifier",
    "CanFeed",
    "CanSignal",
    "Command",
    "DbcDecoder",
    "ModbusFeed",
    "NiClocks",
    "NiCounter",
    "NiInput",
    "NiSource",
    "Register",
    "ReplaySource",
    "RsiFeed",
    "RsiSignal",
    "SerialLink",
    "TachometerFeed",
    "TcpLink",
]
