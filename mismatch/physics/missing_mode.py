"""A mode that the nominal model lacks."""

import numpy as np

from .protocol import Parameter

MOST_DAMPED = 0.3
"""Damping ratio above which a pole shapes a slope, not a peak: what asks for it is a force of another form. It is three
times the largest of a milling robot in the source papers (0.0996; Mohammadi & Ahmadi, Table 1)."""


class MissingMode:
    """A resonance that the modal test overlooked, or that a part mounted since has added."""

    name = "missing_mode"
    equation = "H += r l^T / (s - p) + conjugate"
    source = "Ewins, Modal Testing, 2nd ed., section 4.4"
    parameters: tuple[Parameter, ...] = ()
    confusable_with = ("unmeasured_excitation", "modal_parameters")

    def overdamped(self, pole: complex) -> str:
        """Why a pole is no mode; empty where it may be one.

        Parameters
        ----------
        pole : rad/s
            Fitted pole, with a positive imaginary part.

        Examples
        --------
        >>> PHYSICS.overdamped(-12.0 + 100.0j), PHYSICS.overdamped(-100.0 + 100.0j)
        ('', 'a mode damped by 71 % is no resonance')
        """
        ratio = -pole.real / abs(pole)
        return f"a mode damped by {100 * ratio:.0f} % is no resonance" if ratio > MOST_DAMPED else ""

    def resolved(self, pole: complex, spacing: float, least: float) -> bool:
        """Tell whether a mode's half-power bandwidth is wider than ``least`` times the ``spacing`` of the lines, Hz."""
        return float(-pole.real / np.pi) > least * spacing


PHYSICS = MissingMode()
