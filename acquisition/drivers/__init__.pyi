from .amplifier import Amplifier, Command
from .can_bus import CanFeed, CanSignal, DbcDecoder
from .modbus_drive import ModbusFeed, Register
from .modbus_link import SerialLink, TcpLink
from .ni import NiSource
from .ni_channels import NiInput
from .replay import ReplaySource
from .tachometer_line import TachometerFeed

__all__ = [
    "Amplifier",
    "CanFeed",
    "CanSignal",
    "Command",
    "DbcDecoder",
    "ModbusFeed",
    "NiInput",
    "NiSource",
    "Register",
    "ReplaySource",
    "SerialLink",
    "TachometerFeed",
    "TcpLink",
]
