"""Signals of CAN logs (BLF of Vector's tools, ASC text), added to a recording of the same time as events."""

import logging
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field

from millfrf.core import FileFormatError, InputError, Real, checked_toml

from ..channels import STRICT, Name
from ..drivers.can_bus import DbcDecoder, SignalTable
from ..recordings.recording import Recording
from ..sources.source import DriverMissing
from .content import recording_content
from .writers import require_writable, written_content

SUFFIXES = (".blf", ".asc")


class LogMapping(BaseModel):
    """Mapping of a log of bus messages to a recording.

    Parameters
    ----------
    recording
        Recording (HDF5) in the folder of the log; its samples and events go into the output too.
    dbc
        DBC file in the folder of the log, which names the signals.
    offset_s : s
        Time of the log's first message on the recording's axis.
    signals
        Signals to keep.
    """

    model_config = STRICT
    recording: Name
    dbc: Name
    offset_s: float = 0.0
    signals: Annotated[tuple[SignalTable, ...], Field(min_length=1)]


def add_can_log(
    log: str | os.PathLike[str],
    target: str | os.PathLike[str],
    mapping: str | os.PathLike[str],
    progress: Callable[[int], None] | None = None,
    provenance: str = "",
) -> Path:
    """Write the recording that the mapping names, with the signals of the log among its events.

    Parameters
    ----------
    log
        File of CAN messages, ``.blf`` or ``.asc``.
    target
        New recording, or a file of another kind that `convert` writes.
    mapping
        TOML file with the keys of `LogMapping`.
    progress
        Function that is called with the number of samples written so far.
    provenance
        Origin of the output as JSON text.

    Returns
    -------
    Path
        Path of the new file.

    Raises
    ------
    InputError, FileFormatError
        A file cannot be used; nothing is written.
    """
    source, out = Path(log), Path(target)
    require_writable(out)
    settings = checked_toml(Path(mapping), LogMapping, "mapping")
    series = _read_can_log(source, DbcDecoder(source.parent / settings.dbc, settings.signals))
    shifted = {name: (times + settings.offset_s, values) for name, (times, values) in series.items()}
    with Recording(source.parent / settings.recording) as recording:
        content = recording_content(recording)
        repeated = sorted(set(content.events) & set(shifted))
        if repeated:
            raise InputError(f"{recording.path.name} has events {', '.join(repeated)} already; name another series")
        merged = replace(content, events={**content.events, **shifted}, provenance=provenance)
        with written_content(merged, out, progress):
            pass
    return out


def _read_can_log(log: Path, decoder: DbcDecoder) -> dict[str, tuple[Real, Real]]:
    """Read the signals of a log: times since the first message (s) and values, by series."""
    if not log.is_file():
        raise InputError(f"no CAN log {log}; check the name")
    try:
        import can  # optional: the extra `devices`
    except ImportError as error:
        raise DriverMissing("CAN logs need the package python-can; pip install millfrf[devices]") from error
    series: dict[str, list[tuple[float, float]]] = {}
    first: float | None = None
    logger = logging.getLogger("can.io.blf")
    was_disabled, logger.disabled = logger.disabled, True  # its warnings of damaged blocks would be a second line
    try:
        with can.LogReader(log) as messages:
            for message in messages:
                first = message.timestamp if first is None else first
                if message.is_error_frame or message.is_remote_frame:
                    continue
                extended = bool(message.is_extended_id)
                for name, value in decoder.decode(message.arbitration_id, bytes(message.data), extended=extended):
                    series.setdefault(name, []).append((message.timestamp - first, value))
    except Exception as error:  # damaged logs make python-can, struct and zlib raise nearly anything
        raise FileFormatError(
            f"{log} cannot be read as {log.suffix}: {' '.join(str(error).split()) or type(error).__name__}"
        ) from error
    finally:
        logger.disabled = was_disabled
    if not series:
        raise FileFormatError(f"{log} holds none of the selected signals; check the DBC file and the bus")
    columns = {name: np.array(pairs).T for name, pairs in series.items()}
    return {name: (times, values) for name, (times, values) in columns.items()}
