"""What of the recordings is held out from fits: a whole one of three, the middle half of two or of one."""

from dataclasses import dataclass

from estimation import WindowedSpectrum

PARTS, PART_LINES = (0.25, 0.75), 24
"""Share of a recording between which it is held out where there are two or fewer; lines at least of what is left."""


@dataclass(frozen=True)
class Recordings:
    """The same recordings twice, weakest first.

    Parameters
    ----------
    mended
        Recordings without tones and with clipped samples put back, to which causes are fitted.
    measured
        Recordings as they were measured, on which errors are counted.
    worst
        Number of the recording of which modal parameters alone, fitted to all, leave most: a law that is felt at one
        of two levels must show there.
    chosen
        Number of a recording that is held out instead of the usual one.
    """

    mended: list[WindowedSpectrum]
    measured: list[WindowedSpectrum]
    worst: int = 0
    chosen: int | None = None

    @property
    def held_out_place(self) -> int:
        """Number of the recording held out: the middle level, so that the others bracket it; of two the worst."""
        if self.chosen is not None:
            return self.chosen
        return self.worst if len(self.mended) == 2 else (len(self.mended) - 1) // 2

    @property
    def in_part(self) -> bool:
        """Whether only the middle half is held out: of two levels one alone says little of a law at the other."""
        here = self.measured[self.held_out_place]
        return len(self.mended) < 3 and PARTS[0] * len(here.frequencies) > PART_LINES

    @property
    def tested(self) -> bool:
        """Whether anything can be held out: not of a single recording that is too short to be parted."""
        return len(self.mended) > 1 or self.in_part

    def others(self, which: list[WindowedSpectrum]) -> list[WindowedSpectrum]:
        """What fits may see: all recordings but the one held out, or the first and last quarter of each.

        Levels keep their weights if all are seen in the same parts.
        """
        if self.in_part:
            return [part for one in which for part in (one.between(0.0, PARTS[0]), one.between(PARTS[1], 1.0))]
        return [one for k, one in enumerate(which) if k != self.held_out_place] or which

    def held_out(self, which: list[WindowedSpectrum]) -> WindowedSpectrum:
        """What fits may not see and errors are told of: a recording, or its middle half."""
        here = which[self.held_out_place]
        return here.between(*PARTS) if self.in_part else here

    def held_out_elsewhere(self, which: list[WindowedSpectrum]) -> dict[int, WindowedSpectrum]:
        """What fits may not see of other recordings than :meth:`held_out`, by their numbers."""
        if not self.in_part:
            return {}
        return {k: one.between(*PARTS) for k, one in enumerate(which) if k != self.held_out_place}
