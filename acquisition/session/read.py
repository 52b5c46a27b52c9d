"""Reading a session file: every mistake in one line that a lab user understands."""

import difflib
import os
import tomllib
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from foundation import FileFormatError, InputError

from .channel_table import ChannelTable
from .feed_tables import AmplifierTable, CanTable, CommandTable, ModbusTable, RegisterTable, SignalTable
from .feed_tables import TachometerTable as _Tachometer
from .tables import LiveTable, NiDevice, ReplayDevice, Session, SimulatedDevice

_TABLES: tuple[type[BaseModel], ...] = (
    *(Session, NiDevice, ReplayDevice, SimulatedDevice, ChannelTable, CanTable, SignalTable),
    *(_Tachometer, ModbusTable, RegisterTable, AmplifierTable, CommandTable, LiveTable),
)
_BY_KEY: dict[str, tuple[type[BaseModel], ...]] = {
    "live": (LiveTable,),
    "device": (NiDevice, ReplayDevice, SimulatedDevice),
    "channels": (ChannelTable,),
    "can": (CanTable,),
    "signals": (SignalTable,),
    "tachometer": (_Tachometer,),
    "modbus": (ModbusTable,),
    "registers": (RegisterTable,),
    "amplifier": (AmplifierTable,),
    "on_open": (CommandTable,),
    "on_close": (CommandTable,),
}
_LARGEST = 1_000_000


def read_session(path: str | os.PathLike[str]) -> Session:
    """Read and check a session file.

    Raises
    ------
    InputError
        No such file, or a value that cannot be: the line names the key, the value and the remedy.
    FileFormatError
        Not TOML.
    """
    return session_from_text(session_text(path), os.fspath(path))


def session_text(path: str | os.PathLike[str]) -> str:
    """The file's text, to be kept in the recording.

    Raises
    ------
    InputError, FileFormatError
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"no session file {path}; check the name")
    if file.stat().st_size > _LARGEST:
        raise FileFormatError(f"{path} has {file.stat().st_size} bytes; that is no session file")
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not text in UTF-8; save it so") from error


def session_from_text(text: str, name: str = "session") -> Session:
    """Check a session given as text.

    Raises
    ------
    InputError, FileFormatError
    """
    try:
        content = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise FileFormatError(f"{name} is not TOML: {' '.join(str(error).split())}") from error
    try:
        return Session.model_validate(content)
    except ValidationError as error:
        mistakes = error.errors(include_url=False)
        more = f" (and {len(mistakes) - 1} more)" if len(mistakes) > 1 else ""
        raise InputError(f"{name}: {_in_words(mistakes[0])}{more}") from error


def _in_words(mistake: Any) -> str:
    """One mistake as a sentence."""
    location = [part for part in mistake["loc"] if part not in ("ni", "replay", "simulated")]
    where = _where(location)
    kind, value = mistake["type"], mistake.get("input")
    if kind == "extra_forbidden":
        return f"{where} is not a known key{_meant(location)}"
    if kind == "missing":
        return f"{where} is missing"
    if kind == "union_tag_not_found":
        return f"{where}.driver is missing; use ni, replay or simulated"
    if kind == "union_tag_invalid":
        return f"{where}.driver is not known; use ni, replay or simulated"
    if kind == "value_error":
        said = str(mistake["ctx"]["error"])
        return f"{where}: {said}" if location else said
    shown = repr(value)
    given = f", not {shown if len(shown) < 60 else shown[:57] + '...'}"
    return f"{where}: {mistake['msg'][0].lower()}{mistake['msg'][1:]}{given}"


def _where(location: list[str | int]) -> str:
    """``channels[2].unit``, counted from 1 as people do."""
    text = ""
    for part in location:
        text += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text or "the file"


def _meant(location: list[str | int]) -> str:
    """The nearest known key, or all of them."""
    parents = [part for part in location[:-1] if isinstance(part, str)]
    models = _BY_KEY.get(parents[-1], _TABLES) if parents else (Session,)
    known = sorted({key for model in models for key in model.model_fields})
    near = difflib.get_close_matches(str(location[-1]), known, 1)
    return f"; did you mean {near[0]}?" if near else f"; known keys: {', '.join(known)}"
