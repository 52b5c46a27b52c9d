"""FRF matrices that lie in one array with several axes: MAT, NPZ, NPY and HDF5 files."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .apart import Parts, frequencies_of
from .entries import FrfEntry
from .frf_mapping import FrfTable
from .numbers import complex_values

AXES = ("frequency", "response", "excitation")


def matrix_entries(parts: Parts) -> tuple[list[FrfEntry], tuple[str, ...]]:
    """Read all entries of an array, in SI units, and say how its axes were taken where the mapping does not say it.

    Parameters
    ----------
    parts
        Places of the parts in a source whose arrays, the coherence's too, have the same axes.

    Raises
    ------
    InputError
        Labels that are missing or do not fit the axes, or axes that lengths do not tell.
    """
    table, source = parts.table, parts.source
    names = [name for name in parts.places if name not in ("frequency", "coherence")]
    values = complex_values({name: source.array(parts.places[name], name) for name in names}, table, str(source.path))
    known = source.array(parts.places["frequency"], "frequency").size if "frequency" in parts.places else None
    _require_labels(parts, values.shape)
    axes, told = _axes(parts, values.shape, known)
    ordered = _ordered(values, axes)
    f = frequencies_of(parts, len(ordered))
    lengths = (len(f), len(table.responses), len(table.excitations))
    if ordered.shape != lengths:
        raise InputError(
            f"{source.path}: the FRF has {_times(ordered.shape)} frequencies, responses and excitations, the mapping "
            f"names {_times(lengths)}; correct axes, responses or excitations"
        )
    coherence = None
    if "coherence" in parts.places:
        coherence = _coherence(parts, values.shape, axes)
    return _entries(parts, f, ordered, coherence), told


def _require_labels(parts: Parts, shape: Sequence[int]) -> None:
    table = parts.table
    for name, labels in (("responses", table.responses), ("excitations", table.excitations)):
        if not labels:
            raise InputError(
                f"{parts.source.path}: the FRF is {_times(shape)}: name its {name} under [frf] of a mapping, as in "
                f'{name} = ["1..3:+Z", "TIP:+X"]'
            )


def _axes(parts: Parts, shape: Sequence[int], known: int | None) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Name of each axis: as told, or by lengths where each fits one axis only."""
    table: FrfTable = parts.table
    if table.axes is not None:
        if len(table.axes) != len(shape):
            raise InputError(
                f"{parts.source.path}: the FRF has {len(shape)} axes ({_times(shape)}) but axes = {list(table.axes)}; "
                "name each once"
            )
        return table.axes, ()
    wanted = {"response": len(table.responses), "excitation": len(table.excitations)}
    if known is not None:
        wanted["frequency"] = known
    ways = [way for way in _ways(len(shape)) if _fits(way, shape, wanted)]
    long = {tuple(name for name, length in zip(way, shape, strict=True) if length > 1) for way in ways}
    if len(long) != 1:
        said = "no" if not ways else "more than one"
        lengths = ", ".join(f"{length} {name}" for name, length in wanted.items())
        raise InputError(
            f"{parts.source.path}: the FRF is {_times(shape)}; with {lengths} there is {said} order of its axes: write "
            'axes = ["frequency", "response", "excitation"] in their order under [frf]'
        )
    told = f"axes of the FRF taken as {', '.join(filter(None, ways[0]))}, by their lengths {_times(shape)}"
    return ways[0], (told,)


def _ways(n_axes: int) -> list[tuple[str, ...]]:
    """Orders of the axes; those that are left out have the length 1, further ones are of length 1 and have no name."""
    from itertools import permutations

    names = (*AXES, *[""] * max(0, n_axes - len(AXES)))
    return sorted(set(permutations(names, n_axes)), key=lambda way: [AXES.index(n) if n else len(AXES) for n in way])


def _fits(way: Sequence[str], shape: Sequence[int], wanted: dict[str, int]) -> bool:
    named = dict(zip(way, shape, strict=True))
    if any(length != 1 for name, length in zip(way, shape, strict=True) if not name):
        return False
    return all(named.get(name, 1) == length for name, length in wanted.items())


def _ordered(values: NDArray[Any], axes: Sequence[str]) -> NDArray[Any]:
    """(n_frequencies, n_responses, n_excitations); axes that are not named have the length 1."""
    keep = tuple(k for k, name in enumerate(axes) if name)
    squeezed = values.reshape([values.shape[k] for k in keep])
    named = [axes[k] for k in keep]
    for name in AXES:
        if name not in named:
            squeezed, named = squeezed[..., np.newaxis], [*named, name]
    return np.ascontiguousarray(np.transpose(squeezed, [named.index(name) for name in AXES]))


def _coherence(parts: Parts, shape: tuple[int, ...], axes: Sequence[str]) -> NDArray[np.float64]:
    coherence = parts.source.array(parts.places["coherence"], "coherence")
    if coherence.shape != shape or np.iscomplexobj(coherence):
        raise InputError(
            f"{parts.source.path}: the coherence is {_times(coherence.shape)}, the FRF {_times(shape)}; name real "
            "numbers on the same axes, or leave the coherence out"
        )
    return np.asarray(_ordered(coherence, axes), dtype=float)


def _entries(
    parts: Parts, f: NDArray[np.float64], values: NDArray[Any], coherence: NDArray[np.float64] | None
) -> list[FrfEntry]:
    table = parts.table
    return [
        FrfEntry(
            response,
            excitation,
            f,
            np.asarray(parts.unit.factor * values[:, p, q], dtype=np.complex128),
            parts.source.path.name,
            None if coherence is None else coherence[:, p, q],
            table.averages or 0,
        )
        for p, response in enumerate(table.responses)
        for q, excitation in enumerate(table.excitations)
    ]


def _times(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape))
