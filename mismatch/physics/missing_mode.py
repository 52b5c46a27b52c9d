"""A mode that the nominal model lacks."""

import numpy as np

from .protocol import Parameter


class MissingMode:
    """A resonance that the modal test overlooked, or that a part mounted since has added."""

    name = "missing_mode"
    equation = "H += r l^T / (s - p) + conjugate"
    source = "Ewins, Modal Testing, 2nd ed., section 4.4"
    parameters: tuple[Parameter, ...] = ()
    confusable_with = ("unmeasured_excitation", "modal_parameters")

    def resolved(self, pole: complex, spacing: float, least: float) -> bool:
        """Tell whether a mode's half-power bandwidth is wider than ``least`` times the ``spacing`` of the lines, Hz."""
        return float(-pole.real / np.pi) > least * spacing


PHYSICS = MissingMode()
