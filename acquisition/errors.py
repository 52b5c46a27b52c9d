"""Errors of a device or a disk while recording; each message names the device and the remedy."""

from millfrf.core import MillfrfError


class DeviceError(MillfrfError):
    """A device did not do its part; base of the errors below."""


class Overrun(DeviceError):
    """Samples were lost because they were not fetched in time.

    Parameters
    ----------
    message
        One line with device and remedy.
    n_missing
        Samples a channel that are missing; None: the device does not tell.
    """

    def __init__(self, message: str, n_missing: int | None = None) -> None:
        super().__init__(message)
        self.n_missing = n_missing


class Disconnected(DeviceError):
    """The device is no longer there: unplugged, switched off, bus gone."""


class DeviceTimeout(DeviceError):
    """The device is there but gave nothing in time.

    Parameters
    ----------
    message
        One line with device and remedy.
    since : s
        Host's monotonic time at which the device was last heard; None: not known.
    """

    def __init__(self, message: str, since: float | None = None) -> None:
        super().__init__(message)
        self.since = since


class DriverMissing(DeviceError):
    """The Python package or the vendor's library that speaks to the device is not installed."""
