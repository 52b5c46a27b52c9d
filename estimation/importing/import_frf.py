"""FRFs of files of other programs, of any format, as one matrix."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError

from .columns import Parts, entries_of, frequencies_of, parts_of
from .entries import FrfEntry, ImportedFrf, assembled, single_frfs
from .frf_mapping import FrfMapping, FrfTable
from .sources import ArraySource, FrfSource, complex_values, open_source
from .text_table import SUFFIXES as TEXT_SUFFIXES
from .uff_frfs import UffChoice, import_uffs

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


UFF_SUFFIXES = (".uff", ".unv")
_TELLING = (*TEXT_SUFFIXES, ".npz", ".mat")


def import_frf(files: Sequence[str | os.PathLike[str]], mapping: FrfMapping | None = None) -> ImportedFrf:
    """Read FRFs from UFF, MAT, NPZ, NPY, HDF5, CSV or text files into one matrix.

    Several files make one matrix: those of a roving hammer or a roving sensor, one FRF or one reference each.

    Parameters
    ----------
    files
        One or more, all UFF or none.
    mapping
        What the files do not say: degrees of freedom, unit, columns, axes. UFF files need none as a rule.

    Returns
    -------
    ImportedFrf
        In SI units, for ``exp(+i w t)``.

    Raises
    ------
    InputError
        Something that nobody says; the message says what to write.
    FileFormatError
        Damaged files, entries that are missing or given twice, axes that differ, values that are not finite.
    """
    paths = [Path(file) for file in files]
    if not paths:
        raise InputError("no file to read FRFs from; give one or more")
    mapping = mapping or FrfMapping()
    uff = [path.suffix.lower() in UFF_SUFFIXES for path in paths]
    if any(uff) and not all(uff):
        raise InputError("UFF files and others are given together; convert them apart")
    found = import_uffs(paths, _choice(paths, mapping)) if all(uff) else _by_parts(paths, mapping)
    tau = mapping.frf.exponential_time_constant_s
    frf = found.frf if tau is None else replace(found.frf, exponential_time_constant=tau)
    return replace(found, frf=frf)


def looks_like_frf(path: str | os.PathLike[str]) -> bool:
    """Whether a text's headings or a file's arrays are without doubt those of FRFs.

    Not asked of HDF5 files: those without a mapping are made here.
    """
    file = Path(path)
    if file.suffix.lower() not in _TELLING:
        return False
    try:
        return len(set(open_source(file).roles()) - {"coherence"}) > 1
    except InputError:
        return False


def _by_parts(paths: Sequence[Path], mapping: FrfMapping) -> ImportedFrf:
    sources = [open_source(path, mapping.csv) for path in paths]
    if not mapping.entries and not mapping.frf.listed and len(sources) == 1 and _is_matrix(sources[0], mapping):
        parts = parts_of(sources[0], mapping)
        entries, told = matrix_entries(parts)
        inferred = tuple(f"{paths[0].name}: {text}" for text in (*parts.inferred, *told))
        return ImportedFrf(assembled(entries, parts.unit.quantity, parts.unit.unit), inferred)
    entries, unit, told = entries_of(sources, mapping)
    return ImportedFrf(assembled(entries, unit.quantity, unit.unit), told)


def _is_matrix(source: FrfSource, mapping: FrfMapping) -> bool:
    """Arrays, unless one response and one excitation say that it is a single FRF."""
    single = len(mapping.frf.responses) == len(mapping.frf.excitations) == 1
    return isinstance(source, ArraySource) and not (single and mapping.frf.axes is None)


def _choice(paths: Sequence[Path], mapping: FrfMapping) -> UffChoice:
    table = mapping.frf
    if table.given or table.listed or table.frequency or table.axes:
        raise InputError(
            f"{paths[0]}: a UFF file says itself where its numbers lie; leave columns and axes out of [frf]"
        )
    frfs = single_frfs(mapping)
    if any(entry.given for entry in frfs) or any(entry.record is None for entry in frfs):
        raise InputError(f"{paths[0]}: entries of a UFF file are named by record (place of the data set), nothing else")
    if mapping.entries and len(paths) > 1:
        raise InputError("entries by record go with one UFF file; convert the files one by one")
    places = {entry.record or 0: (entry.response, entry.excitation) for entry in frfs}
    return UffChoice(
        table.quantity, table.unit, table.responses, table.excitations, places or None, table.conjugate, table.averages
    )
