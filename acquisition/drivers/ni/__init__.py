"""National Instruments modules through DAQmx: inputs, counters, clocks, and what the devices say of themselves."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
