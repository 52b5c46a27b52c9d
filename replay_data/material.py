"""Workpiece material: homogeneous, or porous so that specific forces vary at random along the cut."""

from dataclasses import dataclass

from millfrf.core import InputError


@dataclass(frozen=True)
class Material:
    """How the specific cutting forces vary from place to place.

    Along each tooth's path the material is divided into cells as long as a pore. In every cell tangential, radial and
    axial force are multiplied by independent random factors ``(1 - spread) + spread * e`` with e exponential of mean 1:
    never negative, mean 1, standard deviation ``spread``. The mean force is that of the homogeneous material; the three
    forces become linearly independent at all frequencies, so that one cut gives the whole FRF matrix (Mohammadi &
    Ahmadi, "Milling of porous material"). The exponential law is assumed.

    Parameters
    ----------
    name
        Name of the material, for the recording's set-up.
    spread
        Standard deviation of the specific forces over their mean, 0 (homogeneous) to 1.
    pore_size : m
        Length of a cell along the tooth path.
    passes_per_pore
        Number of successive tooth passes that meet the same cells (pore size over feed per tooth); 1: every tooth
        meets new ones.

    Raises
    ------
    InputError
        A value outside these bounds.

    Examples
    --------
    >>> Material("foam", spread=1.5)
    Traceback (most recent call last):
    millfrf.core.errors.InputError: spread = 1.5 of material foam must lie in 0 ... 1
    """

    name: str
    spread: float = 0.0
    pore_size: float = 1e-3
    passes_per_pore: int = 1

    def __post_init__(self) -> None:
        if not 0 <= self.spread <= 1:
            raise InputError(f"spread = {self.spread!r} of material {self.name} must lie in 0 ... 1")
        if not self.pore_size > 0:
            raise InputError(f"pore size {self.pore_size!r} m of material {self.name} must be positive")
        if not (isinstance(self.passes_per_pore, int) and self.passes_per_pore >= 1):
            raise InputError(
                f"passes per pore {self.passes_per_pore!r} of material {self.name} must be 1 or more, whole"
            )


_BY_NAME = {
    "homogeneous": Material("homogeneous"),
    "porous": Material("porous", spread=0.9, pore_size=1.5e-3),
}


def material_named(material: str | Material) -> Material:
    """``"homogeneous"``, ``"porous"`` (spread 0.9, pores of 1.5 mm: a coarse metal foam), or the material given.

    Raises
    ------
    InputError
        Another name.

    Examples
    --------
    >>> material_named("homogeneous").spread
    0.0
    """
    if isinstance(material, Material):
        return material
    if material not in _BY_NAME:
        raise InputError(f"unknown material {material!r}; use {' or '.join(_BY_NAME)}, or a Material")
    return _BY_NAME[material]
