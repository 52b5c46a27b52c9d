"""Tool file: a tool, or a blank that was tapped, as round segments from the holder to the tip."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, model_validator

from millfrf.core import InputError, checked_toml

Above0 = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(gt=0, le=1)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class MaterialTable(_Table):
    """Isotropic elastic material of segments.

    Parameters
    ----------
    youngs_modulus_pa : Pa
        Young's modulus. Carbide: 530e9 to 640e9, steel: 200e9 to 210e9.
    density_kg_per_m3 : kg/m^3
        Density. Carbide: 14000 to 15000, steel: 7800.
    poissons_ratio
        Poisson's ratio. Carbide: 0.22, steel: 0.29.
    loss_factor
        Structural loss factor of the material alone; a holder damps far more.
    youngs_modulus_std_share
        Standard error of Young's modulus as a share of it.
    density_std_share
        Standard error of the density as a share of it.
    """

    youngs_modulus_pa: Above0
    density_kg_per_m3: Above0
    poissons_ratio: Annotated[float, Field(ge=0, lt=0.5)] = 0.25
    loss_factor: NotNegative = 0.001
    youngs_modulus_std_share: Annotated[float, Field(ge=0, lt=0.5)] = 0.02
    density_std_share: Annotated[float, Field(ge=0, lt=0.5)] = 0.01


class SegmentTable(_Table):
    """Round segment of a tool or holder.

    Parameters
    ----------
    material
        Name of its material.
    length_m : m
        Length along the tool.
    diameter_m : m
        Outer diameter; of a fluted segment that of the cutter.
    inner_diameter_m : m
        Diameter of a bore, 0: solid.
    fluted
        Whether it has flutes: a cylinder of ``effective_share`` times the diameter stands for it.
    effective_share
        Effective diameter of a fluted segment as a share of the cutter's.
    effective_share_std
        Standard error of ``effective_share``.
    contact
        Whether a contact joins it to the segment before (tool in collet), whose stiffness the taps shall show.
    """

    material: str
    length_m: Above0
    diameter_m: Above0
    inner_diameter_m: NotNegative = 0.0
    fluted: bool = False
    effective_share: Share = 0.8
    effective_share_std: Annotated[float, Field(ge=0, lt=0.5)] = 0.03
    contact: bool = False

    @model_validator(mode="after")
    def _bore_fits(self) -> "SegmentTable":
        share = self.effective_share if self.fluted else 1.0
        if self.inner_diameter_m >= share * self.diameter_m:
            raise ValueError(
                f"inner_diameter_m {self.inner_diameter_m:g} must be below the (effective) diameter "
                f"{share * self.diameter_m:g}"
            )
        return self


class ToolTable(_Table):
    """A tool, or a blank that was tapped, as round segments from the holder to the tip.

    Parameters
    ----------
    frf
        FRF file of taps on this blank, beside this file; a tool that is predicted has none.
    stickout_std_m : m
        Standard error of the length out of the holder, which the first segment after the holder's takes up.
    distance_from_tip_m : m
        Distance of each node of the FRF from the tip, by its name, such as ``TCP = 0.0``.
    material
        Materials by name; the same name in the file of a blank and of a tool is the same material.
    segment
        Segments from the holder to the tip, all that is not part of the base.
    """

    frf: str = ""
    stickout_std_m: NotNegative = 1e-4
    distance_from_tip_m: dict[str, NotNegative] = Field(default_factory=dict)
    material: dict[str, MaterialTable]
    segment: Annotated[tuple[SegmentTable, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _consistent(self) -> "ToolTable":
        for segment in self.segment:
            if segment.material not in self.material:
                raise ValueError(f"segment of {segment.material!r}: add a table [material.{segment.material}]")
        if self.segment[0].contact:
            raise ValueError(
                "contact of the first segment: its flexibility is part of the base; leave contact out, or describe "
                "the holder's end as a segment before it"
            )
        if sum(segment.contact for segment in self.segment) > 1:
            raise ValueError("more than one segment has contact = true; one contact can be found")
        length = sum(segment.length_m for segment in self.segment)
        for node, distance in self.distance_from_tip_m.items():
            if distance > length * (1 + 1e-9):
                raise ValueError(f"{node} is {distance:g} m from the tip of a tool {length:g} m long; correct either")
        return self


@dataclass(frozen=True)
class Tool:
    """A tool with the errors of its description.

    Parameters
    ----------
    name
        Name of its file.
    table
        Content of its file.
    """

    name: str
    table: ToolTable

    @property
    def length(self) -> float:
        """Length of all segments, m."""
        return sum(segment.length_m for segment in self.table.segment)

    @property
    def first_of_tool(self) -> int:
        """Number of the first segment of the tool: the one behind the contact, otherwise 0."""
        return next((k for k, segment in enumerate(self.table.segment) if segment.contact), 0)

    def uncertain(self) -> dict[str, float]:
        """Return what is uncertain by its name, with the standard error; quantities of materials as shares.

        Names of a material's quantities are the same in all files, because it is the same material.
        """
        used = dict.fromkeys(segment.material for segment in self.table.segment)
        errors = {f"Young's modulus of {name}": self.table.material[name].youngs_modulus_std_share for name in used}
        errors |= {f"density of {name}": self.table.material[name].density_std_share for name in used}
        errors[f"length of {self.name}"] = self.table.stickout_std_m
        shares = [segment.effective_share_std for segment in self.table.segment if segment.fluted]
        errors[f"flutes of {self.name}"] = max(shares, default=0.0)
        return {name: error for name, error in errors.items() if error > 0}

    def changed(self, changes: dict[str, float]) -> "Tool":
        """Return the tool with changes of uncertain quantities by name, in units of their standard errors."""
        errors, table = self.uncertain(), self.table
        by = {name: changes.get(name, 0.0) * error for name, error in errors.items()}
        if not any(by.values()):
            return self
        materials = {
            name: material.model_copy(
                update={
                    "youngs_modulus_pa": material.youngs_modulus_pa * (1 + by.get(f"Young's modulus of {name}", 0.0)),
                    "density_kg_per_m3": material.density_kg_per_m3 * (1 + by.get(f"density of {name}", 0.0)),
                }
            )
            for name, material in table.material.items()
        }
        share, length = by.get(f"flutes of {self.name}", 0.0), by.get(f"length of {self.name}", 0.0)
        segments = [
            segment.model_copy(update={"effective_share": segment.effective_share + share}) for segment in table.segment
        ]
        first = self.first_of_tool
        segments[first] = segments[first].model_copy(update={"length_m": segments[first].length_m + length})
        return replace(self, table=table.model_copy(update={"material": materials, "segment": tuple(segments)}))


def read_tool(path: str | os.PathLike[str]) -> Tool:
    """Read a tool file.

    Raises
    ------
    InputError
        No such file, or a key that is unknown, missing or out of range.
    """
    return Tool(Path(path).name, checked_toml(Path(path), ToolTable, "tool file"))


def check_together(tools: Sequence[Tool]) -> None:
    """Check that tools have different names, and that materials of the same name agree between them.

    Raises
    ------
    InputError
        Two files of one name, or a material that two files describe differently.
    """
    names = [tool.name for tool in tools]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two tool files have the name {name}, which names the errors of its tool; rename one")
    stated: dict[str, tuple[MaterialTable, str]] = {}
    for tool in tools:
        for name, material in tool.table.material.items():
            other, file = stated.setdefault(name, (material, tool.name))
            if other != material:
                raise InputError(
                    f"material {name!r} differs between {file} and {tool.name}; give both the same numbers, or "
                    "another name"
                )
