"""What a hypothesis leaves, in the two numbers that every verdict is made of."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Remainder:
    """What is left beyond noise.

    Parameters
    ----------
    share
        Measure that says by itself whether this is noise: of a structure and of a cut the share of the residual's power
        that is no noise, of a robot the excess cost for each deviation that the recordings tell.
    size
        The same in a unit that does not change between hypotheses, so that two remainders can be compared.
    """

    share: float
    size: float

    def noise_like(self, most: float) -> bool:
        """Whether it passes for noise: its share is at most ``most``."""
        return self.share <= most
