from .connections import CountedServer
from .guard import Guard, Limits, hosts_of
from .handlers import Guarded, Missing
from .server import LOOPBACK, LiveServer

__all__ = ["LOOPBACK", "CountedServer", "Guard", "Guarded", "Limits", "LiveServer", "Missing", "hosts_of"]
