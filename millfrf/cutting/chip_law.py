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
    A chip of 0.1 mm needs as much force as one of 0.178 mm would with the pressure on a chip of 1 mm.

    >>> steel = ChipLaw((0.25, 0.25, 0.25), edge_radius=1e-5)
    >>> (1e3 * steel.equivalent_chips(np.array([1e-3, 1e-4]))[:, 0]).round(3).tolist()
    [1.0, 0.178]
    """

    exponents: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reference: float = 1e-3
    edge_radius: float = 0.0

    def __post_init__(self) -> None:
        for name, exponent in zip(("ktc", "krc", "kac"), self.exponents, strict=True):
            if not 0 <= exponent < 1:
                raise InputError(f"{name}_exponent = {exponent!r} must be 0 to below 1, as 0.25 of many steels")
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

    def slopes(self, chips: Real) -> Real:
        """Return the change of force per chip thickness over the stated coefficients, (n, 3), at chips (n,), m."""
        exponents, bounded = np.array(self.exponents), np.maximum(chips, self.edge_radius)[:, None]
        return np.asarray((1 - exponents) * (bounded / self.reference) ** -exponents)

    def equivalent_chips(self, chips: Real) -> Real:
        """Return the chips (n, 3), m, that need the same force with the stated coefficients as chips (n,), m."""
        return equivalent_chips(chips, np.array(self.exponents), self.reference, self.edge_radius)


CONSTANT_LAW = ChipLaw()


def equivalent_chips(chips: Real, exponents: Real, reference: float, edge_radius: float) -> Real:
    """Return what :meth:`ChipLaw.equivalent_chips` returns, for exponents (3,) of any size, as a fit may try them."""
    bounded = np.maximum(chips, edge_radius)[:, None]
    return np.asarray((bounded / reference) ** -exponents * ((1 - exponents) * chips[:, None] + exponents * bounded))


@compiled("(float64, float64, float64, float64)")
def relative_pressure(chip: float, exponent: float, reference: float, edge_radius: float) -> float:
    """Return a coefficient over its stated value, ``(h* / h_0)^-m``, at a chip (m)."""
    if exponent == 0.0:
        return 1.0
    return float((max(chip, edge_radius) / reference) ** -exponent)


@compiled("(float64, float64, float64, float64)")
def equivalent_chip(chip: float, exponent: float, reference: float, edge_radius: float) -> float:
    """Return what :meth:`ChipLaw.equivalent_chips` returns, for one chip (m) and one exponent."""
    bounded = max(chip, edge_radius)
    return relative_pressure(chip, exponent, reference, edge_radius) * ((1.0 - exponent) * chip + exponent * bounded)
