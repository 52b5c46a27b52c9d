"""FRFs of files of other programs, in any format, in one matrix."""

import os
from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acquisition import SHEET_SUFFIXES, TEXT_SUFFIXES
from millfrf.core import InputError

from .columns import Parts, entries_of, parts_of
from .entries import FrfEntry, ImportedFrf, assembled
from .frf_mapping import FrfMapping, single_frfs
from .sources import ArraySource, FrfSource, complex_values, open_source, shape_text
from .uff_frfs import UffChoice, import_uffs

AXES = ("frequency", "response", "excitation")


def import_frf(files: Sequence[str | os.PathLike[str]], mapping: FrfMapping | None = None) -> ImportedFrf:
    """Read FRFs from UFF, MAT, NPZ, NPY, HDF5, CSV or text files into one matrix.

    Several files make one matrix, such as files of a roving hammer or sensor with one FRF or one reference each.

    Parameters
    ----------
    files
        One or more files, all UFF or none.
    mapping
        Facts that the files do not state: degrees of freedom, unit, columns, axes. Most UFF files need no mapping.

    Returns
    -------
    ImportedFrf
        FRF in SI units, for ``exp(+i w t)``.

    Raises
    ------
    InputError
        A fact that neither files nor mapping state; the message gives the line to write.
    FileFormatError
        Damaged files, entries that are given twice, entries without which the matrix has no whole blocks with a drive
        point each, axes that differ, values that are not finite.
    """
    paths = [Path(file) for file in files]
    if not paths:
        raise InputError("no file to read FRFs from; give one or more")
    mapping = mapping or FrfMapping()
    is_uff = [path.suffix.lower() in (".uff", ".unv") for path in paths]
    if any(is_uff) and not all(is_uff):
        raise InputError("UFF files and others are given together; convert them separately")
    imported = import_uffs(paths, _uff_choice(paths, mapping)) if all(is_uff) else _import_parts(paths, mapping)
    if missing := imported.frf.unmeasured:
        remark = f"{missing} (response / excitation) is not in the files, or 0 on all lines: not measured, taken as 0"
        imported = replace(imported, inferred=(*imported.inferred, remark))
    time_constant = mapping.frf.exponential_time_constant_s
    if time_constant is None:
        return imported
    return replace(imported, frf=replace(imported.frf, exponential_time_constant=time_constant))


def looks_like_frf(path: str | os.PathLike[str]) -> bool:
    """Return whether the headings of a text, or the arrays of a MAT or NPZ file, are certainly those of FRFs.

    HDF5 files are not examined: without a mapping they were written by millfrf and state their format.
    """
    file = Path(path)
    if file.suffix.lower() not in (*TEXT_SUFFIXES, *SHEET_SUFFIXES, ".npz", ".mat"):
        return False
    try:
        return len(set(open_source(file).roles()) - {"coherence"}) > 1
    except InputError:
        return False


def _import_parts(paths: Sequence[Path], mapping: FrfMapping) -> ImportedFrf:
    sources = [open_source(path, mapping.csv) for path in paths]
    if not mapping.entries and not mapping.frf.place_lists and len(sources) == 1 and _is_matrix(sources[0], mapping):
        parts = parts_of(sources[0], mapping)
        entries, remarks = _matrix_entries(parts)
        inferred = tuple(f"{paths[0].name}: {text}" for text in (*parts.inferred, *remarks))
        frf, doubts = assembled(entries, parts.unit.quantity, parts.unit.unit)
        return ImportedFrf(frf, inferred, (*parts.doubts, *doubts))
    entries, unit, inferred, doubts = entries_of(sources, mapping)
    frf, doubts_of_lines = assembled(entries, unit.quantity, unit.unit)
    return ImportedFrf(frf, inferred, (*doubts, *doubts_of_lines))


def _is_matrix(source: FrfSource, mapping: FrfMapping) -> bool:
    """Return whether the arrays hold a matrix.

    They do not where a mapping names one response and one excitation and no axes.
    """
    single = len(mapping.frf.responses) == len(mapping.frf.excitations) == 1
    return isinstance(source, ArraySource) and not (single and mapping.frf.axes is None)


def _uff_choice(paths: Sequence[Path], mapping: FrfMapping) -> UffChoice:
    table = mapping.frf
    if table.places or table.place_lists or table.frequency or table.axes:
        raise InputError(f"{paths[0]}: a UFF file states where its numbers are; leave columns and axes out of [frf]")
    frfs = single_frfs(mapping)
    if any(frf.places for frf in frfs) or any(frf.record is None for frf in frfs):
        raise InputError(f"{paths[0]}: entries of a UFF file are named by record (place of the data set), nothing else")
    if mapping.entries and len(paths) > 1:
        raise InputError("entries by record go with one UFF file; convert the files one by one")
    places = {frf.record or 0: (frf.response, frf.excitation) for frf in frfs}
    return UffChoice(
        table.quantity,
        table.unit,
        table.responses,
        table.excitations,
        places or None,
        table.frequency_unit,
        table.conjugate,
        table.averages,
    )


def _matrix_entries(parts: Parts) -> tuple[list[FrfEntry], tuple[str, ...]]:
    """Return all entries of the arrays in SI units, and a remark where the axes were found by their lengths.

    All arrays, including the coherence, have the same axes.
    """
    table, source = parts.table, parts.source
    arrays = {
        name: source.array(place, name)
        for name, place in parts.places.items()
        if name not in ("frequency", "coherence")
    }
    values = complex_values(arrays, table, source.path)
    n_lines = source.array(parts.places["frequency"], "frequency").size if "frequency" in parts.places else None
    for name, labels in (("responses", table.responses), ("excitations", table.excitations)):
        if not labels:
            raise InputError(
                f"{source.path}: the FRF is {shape_text(values.shape)}: name its {name} under [frf] of a mapping, as "
                f'in {name} = ["1..3:+Z", "TIP:+X"]'
            )
    axes, remarks = _axes(parts, values.shape, n_lines)
    ordered = _ordered(values, axes)
    f = parts.frequencies(len(ordered))
    lengths = (len(f), len(table.responses), len(table.excitations))
    if ordered.shape != lengths:
        raise InputError(
            f"{source.path}: the FRF has {shape_text(ordered.shape)} frequencies, responses and excitations, the "
            f"mapping names {shape_text(lengths)}; correct axes, responses or excitations"
        )
    coherence = None
    if "coherence" in parts.places:
        array = source.array(parts.places["coherence"], "coherence")
        if array.shape != values.shape or np.iscomplexobj(array):
            raise InputError(
                f"{source.path}: the coherence is {shape_text(array.shape)}, the FRF {shape_text(values.shape)}; name "
                "real numbers on the same axes, or leave the coherence out"
            )
        coherence = np.asarray(_ordered(array, axes), dtype=float)
    entries = [
        FrfEntry(
            response,
            excitation,
            f,
            np.asarray(parts.unit.factor * ordered[:, p, q], dtype=np.complex128),
            source.path.name,
            None if coherence is None else coherence[:, p, q],
            table.averages or 0,
        )
        for p, response in enumerate(table.responses)
        for q, excitation in enumerate(table.excitations)
    ]
    return entries, remarks


def _axes(parts: Parts, shape: tuple[int, ...], n_lines: int | None) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the name of each axis, from the mapping or by the lengths where only one order fits, and a remark."""
    table, path = parts.table, parts.source.path
    if table.axes is not None:
        if len(table.axes) != len(shape):
            raise InputError(
                f"{path}: the FRF has {len(shape)} axes ({shape_text(shape)}) but axes = {list(table.axes)}; name each "
                "once"
            )
        return table.axes, ()
    lengths = {"response": len(table.responses), "excitation": len(table.excitations)}
    if n_lines is not None:
        lengths["frequency"] = n_lines
    orders = [order for order in _orders(len(shape)) if _fits(order, shape, lengths)]
    # orders that differ only in axes of length 1 give the same matrix
    distinct = {tuple(name for name, n in zip(order, shape, strict=True) if n > 1) for order in orders}
    if len(distinct) != 1:
        number = "more than one" if orders else "no"
        text = ", ".join(f"{n} {name}" for name, n in lengths.items())
        raise InputError(
            f"{path}: the FRF is {shape_text(shape)}; with {text} there is {number} order of its axes: write axes = "
            '["frequency", "response", "excitation"] in their order under [frf]'
        )
    names = ", ".join(filter(None, orders[0]))
    return orders[0], (f"axes of the FRF taken as {names}, by their lengths {shape_text(shape)}",)


def _orders(n_axes: int) -> list[tuple[str, ...]]:
    """Return the possible names of axes in order; axes beyond three have the length 1 and an empty name."""
    names = (*AXES, *[""] * max(0, n_axes - len(AXES)))
    rank = {name: k for k, name in enumerate((*AXES, ""))}
    return sorted(set(permutations(names, n_axes)), key=lambda order: [rank[name] for name in order])


def _fits(order: Sequence[str], shape: Sequence[int], lengths: dict[str, int]) -> bool:
    if any(n != 1 for name, n in zip(order, shape, strict=True) if not name):
        return False
    named = dict(zip(order, shape, strict=True))
    return all(named.get(name, 1) == length for name, length in lengths.items())


def _ordered(values: NDArray[Any], axes: Sequence[str]) -> NDArray[Any]:
    """Arrange values as (n_frequencies, n_responses, n_excitations); an axis that is not named gets the length 1."""
    named = [name for name in axes if name]
    array = values.reshape([n for name, n in zip(axes, values.shape, strict=True) if name])
    for name in AXES:
        if name not in named:
            array, named = array[..., np.newaxis], [*named, name]
    return np.ascontiguousarray(np.transpose(array, [named.index(name) for name in AXES]))
