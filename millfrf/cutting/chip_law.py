"""Size effect: force coefficients that fall with the chip thickness, as far down as the radius of the edge."""

import math
from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError, Real
from millfrf.core.compilation import compiled


@dataclass(frozen=True)
class ChipLaw:
    """Kienzle's law of the force per width of the edge, for tangential, radial and axial force.

    ``F(h) = K h (h / h_0)^-m`` for chips above the radius r of the cutting edge (Kienzle, VDI-Zeitschrift 94, 1952,
    299-305). A thinner chip is pressed under the rounded edge, and no power of h describes its force: the force follows
    the law's tangent at r there,

    ``F(h) = K (h* / h_0)^-m [(1 - m) h + m h*]`` with ``h* = max(h, r)``,

    so that the stiffness ``dF/dh = (1 - m) K (h* / h_0)^-m`` is continuous and bounded. Below r this is a constant
    coefficient with an edge force of ``m K (r / h_0)^-m r``.

    Parameters
    ----------
    exponents : (3,)
        m of the tangential, radial and axial force, 0 to below 1; 0: a coefficient that does not depend on the chip.
    reference : m
        Chip thickness h_0 at which a coefficient has its stated value K.
    edge_radius : m
        Radius r of the cutting edge; above 0 with an exponent.

    Raises
    ------
    InputError
        A value outside these bounds.

    Examples
    --------
    >>> steel = ChipLaw((0.25, 0.25, 0.25), edge_radius=1e-5)
    >>> steel.pressures(np.array([1e-3, 1e-4]))[:, 0].round(3).tolist()
    [1.0, 1.778]
    """

    exponents: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reference: float = 1e-3
    edge_radius: float = 0.0

    def __post_init__(self) -> None:
        for name, exponent in zip(("ktc", "krc", "kac"), self.exponents, strict=True):
            if not 0 <= exponent < 1:
                raise InputError(f"{name}_exponent = {exponent!r} must be 0 to below 1; Kienzle's of steels are near 0.25")
        if not (math.isfinite(self.reference) and self.reference > 0):
            raise InputError(f"reference_chip = {self.reference!r} m must be positive and finite")
        if not (math.isfinite(self.edge_radius) and self.edge_radius >= 0):
            raise InputError(f"edge_radius = {self.edge_radius!r} m must be zero or more, and finite")
        if self.varies and not self.edge_radius:
            raise InputError(
                "an exponent needs the radius of the cutting edges, below which a chip is too thin for the law; give "
                "edge_radius_m, 5e-6 to 20e-6 m for new carbide edges"
            )

    @property
    def varies(self) -> bool:
        """Check whether a coefficient depends on the chip thickness."""
        return any(self.exponents)

    def pressures(self, chips: Real) -> Real:
        """Return coefficients over their stated values, ``(h* / h_0)^-m``, at chips (n,), m, shape (n, 3)."""
        relative = np.maximum(chips, self.edge_radius) / self.reference
        if not self.varies:
            return np.ones((len(relative), 3))
        return np.asarray(relative[:, None] ** -np.array(self.exponents))

    def slopes(self, chips: Real) -> Real:
        """Return the change of force per chip thickness over the stated coefficients, (n, 3), at chips (n,), m."""
        return np.asarray((1 - np.array(self.exponents)) * self.pressures(chips))

    def forces(self, chips: Real) -> Real:
        """Return the force per width over the stated coefficients, (n, 3), m, at chips (n,) of 0 or more, m."""
        exponents, bounded = np.array(self.exponents), np.maximum(chips, self.edge_radius)[:, None]
        return np.asarray(self.pressures(chips) * ((1 - exponents) * chips[:, None] + exponents * bounded))


@compiled("(float64, float64, float64, float64)")
def relative_pressure(chip: float, exponent: float, reference: float, edge_radius: float) -> float:
    """Return what :meth:`ChipLaw.pressures` returns, for one chip (m) and one exponent."""
    if exponent == 0.0:
        return 1.0
    return float((max(chip, edge_radius) / reference) ** -exponent)


@compiled("(float64, float64, float64, float64)")
def relative_force(chip: float, exponent: float, reference: float, edge_radius: float) -> float:
    """Return what :meth:`ChipLaw.forces` returns, for one chip (m) and one exponent."""
    bounded = max(chip, edge_radius)
    return relative_pressure(chip, exponent, reference, edge_radius) * ((1.0 - exponent) * chip + exponent * bounded)
