"""CAN logs (BLF of Vector's tools, ASC text) become the events of a recording that was made at the same time."""

import logging
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from millfrf.core import FileFormatError, InputError, checked_toml, writing_whole_file

from ..drivers.can_bus import CanSignal, DbcDecoder
from ..errors import DriverMissing
from ..recordings.recording import Recording
from .content import recording_content
from .writers import require_writable, write_content

SUFFIXES = (".blf", ".asc")
_STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class LogSignal(BaseModel):
    """A signal to keep; see `CanSignal`.

    Parameters
    ----------
    signal
        Name in the DBC file: ``Speed``, or ``Message.Speed`` where several messages have a signal of that name.
    series
        Name of the event series in the recording; empty: the same.
    factor
        Factor to SI units; to rpm for the series ``spindle_speed_rpm``, which ``chatter`` reads.
    """

    model_config = _STRICT
    signal: Annotated[str, Field(min_length=1)]
    series: str = ""
    factor: float = 1.0


class LogMapping(BaseModel):
    """Mapping of a log of bus messages to a recording.

    Parameters
    ----------
    recording
        Recording (HDF5) beside the log; its samples and events go into the output too.
    dbc
        File beside the log that names the signals.
    offset_s : s
        Time of the log's first message on the recording's axis.
    signals
        Signals to keep.
    """

    model_config = _STRICT
    recording: Annotated[str, Field(min_length=1)]
    dbc: Annotated[str, Field(min_length=1)]
    offset_s: float = 0.0
    signals: Annotated[tuple[LogSignal, ...], Field(min_length=1)]


def add_can_log(
    log: str | os.PathLike[str],
    target: str | os.PathLike[str],
    mapping: str | os.PathLike[str],
    progress: Callable[[int], None] | None = None,
    provenance: str = "",
) -> Path:
    """Write the recording that the mapping names with the log's signals among its events.

    Parameters
    ----------
    log
        ``.blf`` or ``.asc``.
    target
        New recording (or another kind that `convert` writes).
    mapping
        TOML file with the keys of `LogMapping`.
    progress
        Called with the number of samples written.
    provenance
        Where the output comes from, as JSON text.

    Raises
    ------
    InputError, FileFormatError
        What is given cannot be used; nothing is written.
    """
    source, out = Path(log), Path(target)
    require_writable(out)
    wanted = checked_toml(Path(mapping), LogMapping, "mapping")
    signals = [CanSignal(each.signal, each.series, each.factor) for each in wanted.signals]
    events = read_can_log(source, DbcDecoder(source.parent / wanted.dbc, signals))
    shifted = {name: (times + wanted.offset_s, values) for name, (times, values) in events.items()}
    with Recording(source.parent / wanted.recording) as recording:
        content = recording_content(recording)
        twice = sorted(set(content.events) & set(shifted))
        if twice:
            raise InputError(f"{recording.path.name} has events {', '.join(twice)} already; name another series")
        with writing_whole_file(out) as temporary:
            whole = replace(content, events={**content.events, **shifted}, provenance=provenance)
            write_content(whole, temporary, progress)
    return out


def read_can_log(log: Path, decoder: DbcDecoder) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Times since the first message (s) and values by series.

    Raises
    ------
    InputError, FileFormatError, DriverMissing
        No such file, a damaged one, or none of the signals in it.
    """
    if not log.is_file():
        raise InputError(f"no CAN log {log}; check the name")
    try:
        import can
    except ImportError as error:
        raise DriverMissing("CAN logs need the package python-can; pip install millfrf[devices]") from error
    found: dict[str, tuple[list[float], list[float]]] = {}
    first: float | None = None
    said = logging.getLogger("can.io.blf")
    silent, said.disabled = said.disabled, True  # its warnings of damaged blocks would be a second line
    try:
        with can.LogReader(log) as messages:
            for message in messages:
                first = message.timestamp if first is None else first
                if not (message.is_error_frame or message.is_remote_frame):
                    _take(message, first, decoder, found)
    except Exception as error:  # damaged logs make python-can, struct and zlib raise nearly anything
        raise FileFormatError(
            f"{log} cannot be read as {log.suffix}: {' '.join(str(error).split()) or type(error).__name__}"
        ) from error
    finally:
        said.disabled = silent
    if not found:
        raise FileFormatError(f"{log} holds none of the wanted signals; check the DBC file and the bus")
    return {name: (np.array(times), np.array(values)) for name, (times, values) in found.items()}


def _take(message: Any, first: float, decoder: DbcDecoder, found: dict[str, tuple[list[float], list[float]]]) -> None:
    for name, value in decoder.decode(
        message.arbitration_id, bytes(message.data), extended=bool(message.is_extended_id)
    ):
        times, values = found.setdefault(name, ([], []))
        times.append(message.timestamp - first)
        values.append(value)
