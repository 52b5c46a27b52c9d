"""FRFs of other laboratories as problems, with the modes that their owners published.

The data are read from ``$MILLFRF_SHARED/data`` or ``../shared/data`` beside the project (its notes on each origin stand
there); they are no part of the project.
"""

import gzip
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .problem import Problem

PLANE_BAND = (10.0, 180.0)
BEAM_BANDS = ((108.0, 116.0), (300.0, 312.0), (590.0, 600.0), (970.0, 980.0))
BEAM_MODES = (112.0, 306.9, 596.4, 974.1)
UNCERTAIN = 0.3
"""Hz; modes whose two published frequencies differ by more are that uncertain."""
# picked by hand from a stabilisation chart of all FRFs, and from a mode indicator
_PICKED = (
    18.837, 40.133, 87.737, 89.673, 97.533, 105.185, 117.880, 125.186, 125.659, 130.032, 135.100, 143.173, 166.223,
)  # fmt: skip
_INDICATED = (18.83, 40.23, 87.97, 89.69, 97.23, 105.21, 118.0, 124.34, 125.61, 129.88, 134.93, 143.08, 166.37)
SUBSETS, SUBSET_POINTS = 20, 10


@dataclass(frozen=True)
class MeasuredRun:
    """One fit of measured FRFs.

    Parameters
    ----------
    group
        Runs that are summed up together.
    counted
        Hz; found modes outside are not counted as invented.
    """

    name: str
    group: str
    problem: Problem
    truth: dict[str, Any]
    counted: tuple[float, float]


def folder() -> Path:
    """Where the data lie.

    Raises
    ------
    FileNotFoundError
        They are not there.
    """
    root = Path(__file__).resolve().parents[2]
    result = Path(os.environ.get("MILLFRF_SHARED", root.parent / "shared")) / "data"
    if not result.is_dir():
        raise FileNotFoundError(f"measured data are not at {result}; set MILLFRF_SHARED to the folder above")
    return result


def plane_runs() -> list[MeasuredRun]:
    """Plane, 74 hammer points x 3 accelerometers: whole, transposed, other band edges, subsets, single sensors."""
    with np.load(folder() / "plane-hammer" / "plane.npz") as file:
        frequencies, matrix = file["frequency_hz"][1:], np.moveaxis(file["accelerance"], 2, 0)[1:]
        coherence = np.clip(np.moveaxis(file["coherence"], 2, 0)[1:], 0.0, 1.0)
    data, everything = _Plane(frequencies, matrix, coherence), np.arange(matrix.shape[1])
    runs = [_plane("plane-whole", "whole", data, everything, (0, 1, 2))]
    runs.append(_plane("plane-transposed", "transposed", data, everything, (0, 1, 2), transposed=True))
    low, high = PLANE_BAND
    for a, b in ((0.95, 1.0), (1.05, 1.0), (1.0, 0.95), (1.0, 1.05)):
        name = f"plane-edges-{low * a:g}-{high * b:g}"
        runs.append(_plane(name, "band edges", data, everything, (0, 1, 2), band=(low * a, high * b)))
    rng = np.random.default_rng(20)
    for number in range(SUBSETS):
        points = np.sort(rng.choice(len(everything), SUBSET_POINTS, replace=False))
        runs.append(_plane(f"plane-subset-{number:02d}", "subsets", data, points, (0, 1, 2)))
    for sensor in range(3):
        runs.append(_plane(f"plane-sensor-{sensor}", "one sensor", data, everything, (sensor,)))
    return runs


@dataclass(frozen=True)
class _Plane:
    frequencies: NDArray[np.float64]
    matrix: NDArray[np.complex128]
    coherence: NDArray[np.float64]


def _plane(
    name: str,
    group: str,
    data: _Plane,
    points: NDArray[np.int64],
    sensors: Sequence[int],
    *,
    transposed: bool = False,
    band: tuple[float, float] = PLANE_BAND,
) -> MeasuredRun:
    """Points along the responses (by reciprocity), or along the excitations as they were struck."""
    values, coherence = (array[:, points][:, :, list(sensors)] for array in (data.matrix, data.coherence))
    struck = tuple(f"P{k + 1}:+{'Z' if k < 68 else 'X'}" for k in points)
    mounted = tuple(f"A{k + 1}:+Z" for k in sensors)
    if transposed:
        values, coherence = values.transpose(0, 2, 1), coherence.transpose(0, 2, 1)
        struck, mounted = mounted, struck
    problem = Problem(
        data.frequencies,
        np.ascontiguousarray(values),
        "accelerance",
        band,
        struck,
        mounted,
        coherence=np.ascontiguousarray(coherence),
        averages=np.zeros(values.shape[1:], dtype=np.int64),  # the source does not say how many
    )
    counted = (max(band[0], PLANE_BAND[0]), min(band[1], PLANE_BAND[1]))
    modes = [
        {"frequency_hz": f, "demanded": True, "uncertain_hz": abs(f - g) if abs(f - g) > UNCERTAIN else 0.0}
        for f, g in zip(_PICKED, _INDICATED, strict=True)
    ]
    return MeasuredRun(name, group, problem, {"modes": modes}, counted)


def beam_runs() -> list[MeasuredRun]:
    """Beam, 9 hammer points x 1 accelerometer: its owner's four bands, both ways round."""
    files = sorted((folder() / "modelab-beam").glob("Hxysv*.txt.gz"))
    tables = [_beam_table(path) for path in files]
    frequencies, values = tables[0][1:, 0], np.stack([t[1:, 1] + 1j * t[1:, 2] for t in tables], axis=1)
    runs = []
    for band, mode in zip(BEAM_BANDS, BEAM_MODES, strict=True):
        near = (frequencies > band[0] - 5) & (frequencies < band[1] + 5)
        points = tuple(f"B{k + 1}:+X" for k in range(len(files)))
        own = {"modes": [{"frequency_hz": mode, "demanded": True}]}
        for group, turned in (("beam", False), ("beam transposed", True)):
            matrix = values[near][:, None, :] if turned else values[near][:, :, None]
            ends = (("A1:-X",), points) if turned else (points, ("A1:-X",))
            problem = Problem(frequencies[near], matrix, "accelerance", band, *ends)
            runs.append(MeasuredRun(f"{group.replace(' ', '-')}-{mode:g}", group, problem, own, band))
    return runs


def _beam_table(path: Path) -> NDArray[np.float64]:
    with gzip.open(path, "rt", encoding="latin-1") as file:
        return np.loadtxt(file, skiprows=9)
