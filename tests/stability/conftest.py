"""Modules of the stability tests that several files use: benchmarks, independent multipliers, simulated cuts."""

import importlib.util
import sys
from pathlib import Path


def _load(name: str) -> None:
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)


for _name in (
    "benchmarks_of_literature",
    "independent_floquet",
    "milling_simulator",
    "random_cuts",
    "streamed_cuts",
    "drawn_cuts",
    "sliced_mill",
    "random_cutters",
):
    _load(_name)
