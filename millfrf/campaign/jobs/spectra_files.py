"""Spectra of tests as files: the sums over segments, and the gain of each test by which sample rates are compared."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from acquisition import Channel
from estimation import CrossSpectra, SpectralSettings

from ...gate import Gain

SPECTRA = "spectra.npz"
_ARRAYS = ("frequencies", "input_spectra", "cross_spectra", "output_spectra")
_NUMBERS = ("n_segments", "effective_averages", "sample_rate", "n_tests", "n_excluded")


def write_spectra(folder: Path, spectra: CrossSpectra, gains: Sequence[Gain]) -> None:
    """Write spectra, summed over one test or several, with the gain of each test, uncompressed."""
    beside: dict[str, Any] = {name: getattr(spectra, name) for name in _NUMBERS}
    beside["excitations"] = [channel.to_json() for channel in spectra.excitations]
    beside["responses"] = [channel.to_json() for channel in spectra.responses]
    beside["settings"] = asdict(spectra.settings)
    beside["gains"] = [{"name": one.name, "rate": one.rate, "first": one.first} for one in gains]
    arrays = {name: getattr(spectra, name) for name in _ARRAYS}
    for number, one in enumerate(gains):
        arrays[f"gain_{number}"], arrays[f"shares_{number}"] = one.values, one.shares
    np.savez(folder / SPECTRA, beside=np.array(json.dumps(beside)), **arrays)


def read_spectra(folder: Path) -> tuple[CrossSpectra, list[Gain]]:
    """Read what :func:`write_spectra` wrote."""
    with np.load(folder / SPECTRA, allow_pickle=False) as stored:
        beside = json.loads(str(stored["beside"]))
        gains = [
            Gain(one["name"], one["rate"], one["first"], stored[f"gain_{number}"], stored[f"shares_{number}"])
            for number, one in enumerate(beside["gains"])
        ]
        spectra = CrossSpectra(
            **{name: stored[name] for name in _ARRAYS},
            **{name: beside[name] for name in _NUMBERS},
            excitations=tuple(Channel.from_json(one) for one in beside["excitations"]),
            responses=tuple(Channel.from_json(one) for one in beside["responses"]),
            settings=SpectralSettings(**beside["settings"]),
        )
    return spectra, gains
