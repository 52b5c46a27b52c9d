"""Options of `robot update` as they were typed."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Asking:
    """Options of an update; None where left out.

    Parameters
    ----------
    poses
        Posture of each file: a name of the robot's file, or degrees with commas.
    feed
        Direction of channel X from the base's x, degrees, with Z up; None: the base's axes.
    band
        Lowest and highest frequency that are compared, Hz.
    sensor
        Housing sensor from the tip, m, in the channels' axes.
    stream
        Sample clock of recordings.
    """

    poses: tuple[str, ...]
    feed: float | None = None
    band: tuple[float, float] | None = None
    sensor: tuple[float, float, float] | None = None
    stream: str | None = None
