"""What a single pole says: natural frequency and damping ratio."""

import math


class OnePole:
    """Frequency and damping of whatever has one ``pole`` (rad/s), for dataclasses to share."""

    pole: complex

    @property
    def frequency(self) -> float:
        """Natural frequency, Hz: ``|pole| / 2 pi``."""
        return abs(self.pole) / (2 * math.pi)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio zeta: ``-Re pole / |pole|``."""
        return -self.pole.real / abs(self.pole)
