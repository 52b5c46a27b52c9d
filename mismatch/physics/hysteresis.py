"""An elastic-plastic element with memory in a joint."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion
from .protocol import DRY, Parameter

Real = NDArray[np.float64]


ELEMENTS = 6
"""Number of elements in parallel; their yields are spread evenly in the logarithm."""


class Hysteresis:
    """Microslip: bolts, gears and bearings stick, slip little by little and remember where they turned."""

    name = "hysteresis"
    beyond = "coulomb_friction"
    equation = "g = sum_i k_i p_i(x), elastic-plastic elements with yields spread around one"
    source = "Iwan 1966, J. Applied Mechanics 33; Bouc 1967, Wen 1976"
    parameters = (
        Parameter("stiffness_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("yield_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
        Parameter("spread", "", 0.2, 0.05, 3.0),
    )
    confusable_with = (
        "coulomb_friction",
        "stiffness_softening",
    )

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, k * motion.deflection, 0.8]) for k in (0.15, 0.3, 1.0, 2.5))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        steps = (np.arange(ELEMENTS) + 0.5) / ELEMENTS
        stiffness, typical, spread = self.held(values, motion)
        yields = typical * np.exp(spread * 2 * (steps - 0.5))
        return JointLaw(springs=np.full(ELEMENTS, stiffness / ELEMENTS), yields=yields)

    def held(self, values: Real, motion: JointMotion) -> Real:
        """Return the numbers that the law uses: an element that yields within less of the motion is dry friction."""
        return np.array([values[0], max(values[1], DRY * motion.deflection), values[2]])

    def strained(self, values: Real, motion: JointMotion) -> bool:
        """Tell whether the numbers ask for elements that yield almost at once, which is dry friction."""
        return bool(values[1] < DRY * motion.deflection)


PHYSICS = Hysteresis()
