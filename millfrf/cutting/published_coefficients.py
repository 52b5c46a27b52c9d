"""Published force coefficients as starting values: each with its source, tool and conditions."""

from dataclasses import dataclass

REVIEW = (
    "Milling force model for aviation aluminum alloy: academic insight and perspective analysis, Chinese Journal of "
    "Mechanical Engineering, 2021, doi:10.1186/s10033-021-00536-9, Table 5, row of its reference {}; edge coefficients "
    "are printed in N mm and read as N/mm"
)


@dataclass(frozen=True)
class PublishedCoefficients:
    """Force coefficients of a material as a publication prints them.

    Parameters
    ----------
    material, conditions, source
        Workpiece, tool and conditions as far as they are printed, and publication.
    tangential, radial, axial : MPa
        ``Ktc``, ``Krc``, ``Kac``; None: not printed.
    edges : (3,), N/mm
        ``Kte``, ``Kre``, ``Kae``; 0 where none is printed.
    """

    material: str
    conditions: str
    source: str
    tangential: float
    radial: float
    axial: float | None = None
    edges: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def entries(self) -> dict[str, float]:
        """Return the keys of a cutting file, shares rounded to the digits that are printed."""
        entries = {"ktc_pa": self.tangential * 1e6, "krc": round(self.radial / self.tangential, 4)}
        if self.axial is not None:
            entries["kac"] = round(self.axial / self.tangential, 4)
        names = ("kte_n_per_m", "kre_n_per_m", "kae_n_per_m")
        return entries | {key: 1e3 * edge for key, edge in zip(names, self.edges, strict=True) if edge}


PUBLISHED = {
    "acetal": PublishedCoefficients(
        "acetal copolymer",
        "end mill of 12.7 mm with two teeth, 0.15 mm per tooth",
        "Mohammadi & Ahmadi, in-process FRF of a milling robot, section on stability lobe diagrams; shares 0.17 and "
        "0.33",
        119.0,
        0.17 * 119.0,
        0.33 * 119.0,
    ),
    "aluminium": PublishedCoefficients(
        "aluminium of the benchmark of stability calculations",
        "two teeth; no edge coefficients, no axial force",
        "Insperger & Stepan, International Journal for Numerical Methods in Engineering 61, 2004, 117-141: "
        "Kt = 6e8, Kn = 2e8 N/m^2",
        600.0,
        200.0,
    ),
    "aluminium-6082-t6": PublishedCoefficients(
        "Al6082-T6", "cemented carbide, dry", REVIEW.format(189), 631.0, 99.0, 273.0, (13.0, 10.0, 2.8)
    ),
    "aluminium-7075": PublishedCoefficients(
        "Al7075", "cemented carbide, dry", REVIEW.format(47), 1319.41, 788.83, 48.75, (19.65, 26.77, 2.05)
    ),
    "aluminium-7075-t6": PublishedCoefficients(
        "Al7075-T6", "cemented carbide, dry", REVIEW.format(190), 767.01, 168.8, 222.0, (27.7, 26.6, 0.7)
    ),
}
"""Starting values by name. They differ between tools and chip thicknesses by half: measure your own."""
