"""`convert`: a file of one kind into a file, or several, of another."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

from foundation import FileFormatError, InputError, writing_whole_file

from ..recordings import Recording
from .array_file import open_arrays
from .assemble import contents
from .content import Content, recording_content
from .csv_file import describes_itself, read_own_csv
from .flat_fields import from_fields
from .mapping import load_mapping
from .span import part_of
from .writers import require_writable, write_content


def convert(
    input_path: str | os.PathLike[str],
    output_path: str | os.PathLike[str],
    mapping_path: str | os.PathLike[str] | None = None,
    progress: Callable[[int], None] | None = None,
    *,
    span: tuple[float, float] | None = None,
    provenance: str = "",
) -> list[Path]:
    """Convert by suffix: ``.h5 .npz .npy .mat .csv`` into ``.h5 .npz .mat .csv``.

    Parameters
    ----------
    input_path
        A recording, a file written by this function, or, with a mapping, one of another program.
    output_path
        File to write; with ``split`` in the mapping ``rec.h5`` becomes ``rec-1.h5``, ``rec-2.h5`` ...
    mapping_path
        TOML file that says which array or column is which channel, see :class:`RecordingMapping`.
    progress
        Called with the number of samples written so far in the file at hand.
    span : s
        First and last time to keep, counted from the first sample; None: all.
    provenance
        Where the output comes from, as JSON text; every kind of file keeps it.

    Returns
    -------
    list[Path]
        The files written; all of them appear, whole, or none.

    Raises
    ------
    InputError, FileFormatError
        What is given cannot be used; nothing is written.
    """
    source, target = Path(input_path), Path(output_path)
    require_writable(target)
    if not source.is_file():
        raise InputError(f"no file {source}; check the name")
    written: list[Path] = []
    with ExitStack() as stack, _contents(source, mapping_path) as (found, several):
        for number, content in enumerate(found, 1):
            path = target.with_name(f"{target.stem}-{number}{target.suffix}") if several else target
            if path.exists() and path.samefile(source):
                raise InputError(f"{path} is the input itself; choose another output name")
            kept = content if span is None else part_of(content, span)
            told = replace(kept, provenance=provenance)
            write_content(told, stack.enter_context(writing_whole_file(path)), progress)
            written.append(path)
    return written


@contextmanager
def _contents(source: Path, mapping_path: str | os.PathLike[str] | None) -> Iterator[tuple[Iterator[Content], bool]]:
    """Contents found in the file, and whether there may be several."""
    if mapping_path is not None:
        mapping = load_mapping(mapping_path)
        yield contents(source, mapping), mapping.split is not None
    elif source.suffix.lower() in (".h5", ".hdf5"):
        with Recording(source) as recording:
            yield iter([recording_content(recording)]), False
    else:
        yield iter([_self_described(source)]), False


def _self_described(source: Path) -> Content:
    """Content of an NPZ, MAT or CSV file that this program wrote."""
    if source.suffix.lower() == ".csv" and describes_itself(source):
        return read_own_csv(source)
    fields = {} if source.suffix.lower() in (".csv", ".txt", ".npy") else open_arrays(source).fields
    if "format" not in fields:
        raise FileFormatError(
            f"{source} does not say what its channels are; give a mapping file (--map map.toml), which this command "
            f"begins: millfrf new mapping {source.name} --out map.toml (for FRFs: one with [frf])"
        )
    return from_fields(fields, source)
