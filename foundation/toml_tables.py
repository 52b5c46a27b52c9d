"""Reading a TOML file into a checked table: what is wrong with it is one line with file, key and value."""

import tomllib
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from .errors import InputError
from .table_mistakes import mistake_in_words

Table = TypeVar("Table", bound=BaseModel)


def checked_toml(path: Path, schema: type[Table], kind: str) -> Table:
    """Read a TOML file and check it by a pydantic model.

    Parameters
    ----------
    path
        Path of the file.
    schema
        Model class that the whole file must satisfy.
    kind
        Word for the file in messages, such as ``mapping``.

    Raises
    ------
    InputError
        No such file, no TOML, or a key that is unknown, missing or out of range; one line with file, key and value.
    """
    try:
        return schema.model_validate(tomllib.loads(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise InputError(f"cannot read {kind} {path}: {error.strerror}; check the name") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"{kind} {path} is not TOML: {error}; correct the line") from error
    except ValidationError as error:
        raise InputError(f"{kind} {path}: {mistake_in_words(error, schema)}") from error
