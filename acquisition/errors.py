"""Errors of a device while recording; each message names the device and the remedy."""

from millfrf.core import MillfrfError


class DeviceError(MillfrfError):
    """A device failed or answered with an error; base class of the errors below."""


class Overrun(DeviceError):
    """Samples were lost because they were not fetched in time.

    ``n_missing`` is the number of samples missing in each channel; None if the device does not report it.
    """

    def __init__(self, message: str, n_missing: int | None = None) -> None:
        super().__init__(message)
        self.n_missing = n_missing


class Disconnected(DeviceError):
    """The device is gone: unplugged, switched off, or its bus is down."""


class DeviceTimeout(DeviceError):
    """The device sent nothing in time.

    ``since`` is the host's monotonic time of the last message, s; None if it is not known.
    """

    def __init__(self, message: str, since: float | None = None) -> None:
        super().__init__(message)
        self.since = since


class DriverMissing(DeviceError):
    """The Python package or the vendor's library of a device is not installed."""
