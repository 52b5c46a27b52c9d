from .ni_clocks import NiClocks
from .ni_counter import NiCounter
from .ni_input import NiInput
from .ni_source import NiSource, ni_9234_rate

__all__ = ["NiClocks", "NiCounter", "NiInput", "NiSource", "ni_9234_rate"]
