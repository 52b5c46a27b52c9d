from .array_file import ArrayFile, open_arrays
from .can_log import SUFFIXES, LogMapping, add_can_log
from .convert_file import convert
from .mapping import ArrayMapping, ChannelMapping, CsvOptions, RecordingMapping, load_mapping
from .uff import UffLines, read_uff_lines, read_uff_sets

__all__ = [
    "SUFFIXES",
    "ArrayFile",
    "ArrayMapping",
    "ChannelMapping",
    "CsvOptions",
    "LogMapping",
    "RecordingMapping",
    "UffLines",
    "add_can_log",
    "convert",
    "load_mapping",
    "open_arrays",
    "read_uff_lines",
    "read_uff_sets",
]
