"""Ways to spoil FRFs and models, and results made from spoilt files as the commands make them."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np

from estimation import Frf, read_frf, write_frf
from millfrf.core import write_json
from modal_fit import read_modal_model, write_modal_model


def frf(folder: Path, file: str, change: str) -> None:
    """Change an FRF file by name of the change."""
    if change in DAMAGE:  # what no program of ours would write
        with h5py.File(folder / file, "r+") as opened:
            DAMAGE[change](opened)
            del opened.attrs["content_sha256"]
        return
    path = folder / file
    write_frf(path, FRF_CHANGES[change](read_frf(path)))


def _negative(opened: h5py.File) -> None:
    opened["frequencies"][0] = -1.0


def _unordered(opened: h5py.File) -> None:
    f = opened["frequencies"][:]
    f[[10, 20]] = f[[20, 10]]
    opened["frequencies"][...] = f


def _nan_lines(opened: h5py.File) -> None:
    values = opened["values"][:]
    values[100:140] = np.nan
    opened["values"][...] = values


def _coherence_five(opened: h5py.File) -> None:
    opened["multiple_coherence"][...] = 5.0


DAMAGE: dict[str, Callable[[h5py.File], None]] = {
    "negative frequency": _negative,
    "unordered frequencies": _unordered,
    "nan lines": _nan_lines,
    "coherence 5": _coherence_five,
}


def _accelerance(frf: Frf) -> np.ndarray:
    return frf.values * ((2j * np.pi * frf.frequencies) ** 2)[:, None, None]


def _poor(frf: Frf) -> Frf:
    rng = np.random.default_rng(4)
    noise = rng.standard_normal(frf.values.shape) + 1j * rng.standard_normal(frf.values.shape)
    coherence = np.full(frf.values.shape[:2], 0.2)
    return replace(frf, values=frf.values + np.abs(frf.values) * noise, multiple_coherence=coherence)


FRF_CHANGES: dict[str, Callable[[Frf], Frf]] = {
    "conjugate": lambda one: replace(one, values=one.values.conj()),
    "all zero": lambda one: replace(one, values=np.zeros_like(one.values)),
    "accelerance called receptance": lambda one: replace(one, values=_accelerance(one)),
    "accelerance": lambda one: replace(one, values=_accelerance(one), quantity="accelerance", unit="m/s^2/N"),
    "kN": lambda one: replace(one, values=1e3 * one.values),
    "mm": lambda one: replace(one, values=1e3 * one.values),
    "reversed sensor": lambda one: replace(one, values=-one.values),
    "in g": lambda one: replace(one, values=one.values / 9.80665),
    "two responses swapped": lambda one: replace(one, values=one.values[:, [1, 0, 2]]),
    "one entry turned": lambda one: replace(one, values=one.values * [[1, -1, 1], [1, 1, 1], [1, 1, 1]]),
    "another structure": lambda one: replace(one, frequencies=2.3 * one.frequencies),
    "poor": _poor,
    "incoherent": lambda one: replace(one, multiple_coherence=np.full(one.values.shape[:2], 0.2), covariance=None),
    "shorter axis": lambda one: replace(
        one,
        frequencies=one.frequencies[::2],
        values=one.values[::2],
        valid=one.valid[::2],
        multiple_coherence=None if one.multiple_coherence is None else one.multiple_coherence[::2],
    ),
}


def model(folder: Path, file: str, change: str) -> None:
    """Change a modal model by name of the change."""
    path = folder / file
    if change in JSON_CHANGES:
        content = json.loads(path.read_text(encoding="utf-8"))
        JSON_CHANGES[change](content)
        write_json(path, content)
        return
    single = read_modal_model(path)
    changed = {
        "in Hz": lambda: replace(single, poles=single.poles / (2 * np.pi)),
        "unstable": lambda: replace(single, poles=-single.poles.conj()),
        "no mode": lambda: replace(single, poles=single.poles[:0], right=single.right[:0], left=single.left[:0]),
        "two directions": lambda: replace(single, right=single.right[:, :2], responses=single.responses[:2]),
        "mm": lambda: replace(single, right=1e3 * single.right),
        "far band": lambda: replace(single, band=(2.0, 3.0)),
        "narrow band": lambda: replace(single, band=(15.0, 20.0)),
    }[change]()
    write_modal_model(path, changed)


JSON_CHANGES: dict[str, Callable[[dict[str, object]], None]] = {
    "missing field": lambda content: content.pop("left") and None,
    "text for numbers": lambda content: content.update(poles_rad_per_s=[["a", "b"]] * 2),
}


def lobes(folder: Path, file: str = "lobes.csv") -> None:
    """Lobes as the command writes them."""
    from millfrf.command_line import run

    base = [str(folder / "model_tip.json"), "--cutting", str(folder / "cut.toml"), "--max-depth", "0.01"]
    assert run(["lobes", *base, "--speeds", "600", "1200", "5", "--out", str(folder / file)]) == 0


def estimated(folder: Path) -> None:
    """An FRF of the sweeps, as the command writes it."""
    from millfrf.command_line import run

    names = [str(folder / f"{name}.h5") for name in ("central", "down", "up")]
    assert run(["estimate", *names, "--segment", "4", "--band", "12", "30", "--out", str(folder / "frf.h5")]) == 0


def fitted(folder: Path) -> None:
    """The model fitted to :func:`estimated`."""
    from millfrf.command_line import run

    assert run(["fit", str(folder / "frf.h5"), "--band", "15.2", "22.5", "--out", str(folder / "model.json")]) == 0
