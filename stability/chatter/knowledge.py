"""`Knowledge`: what is known of a cut beside its recording."""

from dataclasses import dataclass

from .fitted_depth import ModelledCut
from .motion import ToolMotion


@dataclass(frozen=True)
class Knowledge:
    """Facts about a cut that are known beside its recording.

    Parameters
    ----------
    runout
        Radial offset of the spindle's axis, m; 0: equal teeth, NaN: not stated, infinite: whatever it takes.
    derivatives : (n_channels,)
        2 for acceleration, 1 for velocity, 0 for displacement or force, of the evidence's channels.
    natural
        Natural frequencies, Hz; empty: not known.
    motion
        Channels of the tool and the chip; None: not known.
    modelled
        Cutter and structure at the tip, channels being the evidence's; None: not known.
    """

    runout: float
    derivatives: tuple[int, ...]
    natural: tuple[float, ...] = ()
    motion: ToolMotion | None = None
    modelled: ModelledCut | None = None
