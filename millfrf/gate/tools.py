"""Checks of tool files: materials and dimensions in the wrong unit."""

from collections.abc import Iterator

from pydantic import BaseModel

from millfrf.core import InputError
from modal_fit import Tool

from .cutting_data import Physical, check_range

# no solid is stiffer than diamond (1.2e12 Pa) or denser than osmium (22600 kg/m^3)
OF_MATERIAL = (
    Physical("youngs_modulus_pa", 1e9, 1.3e12, (6e10, 6.6e11), " Pa", "is it in GPa (times 1e9)"),
    Physical("density_kg_per_m3", 500, 2.3e4, (2500, 1.6e4), " kg/m^3", "is it in g/cm^3 (times 1000)"),
)
OF_SEGMENT = (
    Physical("length_m", 1e-4, 2.0, (5e-4, 0.6), " m", "is it in mm"),
    Physical("diameter_m", 1e-4, 0.5, (5e-4, 0.2), " m", "is it in mm"),
)


def check_tool(tool: Tool) -> list[str]:
    """Check materials and dimensions of a tool file, and return warnings about unusual values.

    Raises
    ------
    InputError
        A value that no tool has, such as a length in millimetres.
    """
    return list(_warnings(tool))


def _warnings(tool: Tool) -> Iterator[str]:
    parts: list[tuple[str, tuple[Physical, ...], BaseModel]] = [
        (f"material {name}", OF_MATERIAL, material) for name, material in tool.table.material.items()
    ]
    parts += [(f"segment {number}", OF_SEGMENT, segment) for number, segment in enumerate(tool.table.segment, 1)]
    for part, ranges, table in parts:
        for limits in ranges:
            try:
                warnings = check_range(limits, getattr(table, limits.key))
            except InputError as error:
                raise InputError(f"{tool.name}, {part}: {error}") from error
            yield from (f"{tool.name}, {part}: {warning}" for warning in warnings)
