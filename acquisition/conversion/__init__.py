"""Conversion between recordings and the files other programs read and write."""

from .array_file import ArrayFile, open_arrays
from .convert_file import convert
from .mapping import ArrayMapping, ChannelMapping, CsvOptions, Mapping, load_mapping
from .uff.lines import UffLines, read_uff_lines
from .uff.sets import read_uff_sets

__all__ = [
    "ArrayFile",
    "ArrayMapping",
    "ChannelMapping",
    "CsvOptions",
    "Mapping",
    "UffLines",
    "convert",
    "load_mapping",
    "open_arrays",
    "read_uff_lines",
    "read_uff_sets",
]
