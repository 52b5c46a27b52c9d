"""Frequencies, dampings and shapes of the nominal model that are farther off than a laboratory's own error."""

import numpy as np

from .protocol import Parameter


class ModalParameters:
    """The structure has changed since its modal test, or the test was wrong.

    For errors of the usual size ``|u|^2`` of n believed numbers has the mean n and the variance 2 n; it counts as odd
    from four standard deviations above the mean.
    """

    name = "modal_parameters"
    equation = "H(u), |u|^2 > n + 4 sqrt(2 n)"
    source = "Balmes, GARTEUR group on ground vibration testing, IMAC XV, 1997 (scatter between 12 laboratories)"
    parameters: tuple[Parameter, ...] = ()
    confusable_with = ("gain_error", "axis_misalignment", "missing_mode")

    def odd(self, deviation: float, count: int) -> bool:
        """Tell whether ``|u|^2`` of ``count`` believed numbers is larger than errors of the usual size make it."""
        return bool(deviation >= count + 4 * np.sqrt(2 * count))


PHYSICS = ModalParameters()
