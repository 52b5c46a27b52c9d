"""Libraries that only some need: loaded when they are asked for, with the remedy where they are missing."""

import importlib
from types import ModuleType

from ..errors import InputError


def optional_library(name: str, purpose: str, extra: str = "notebook") -> ModuleType:
    """The library, imported.

    Parameters
    ----------
    name
        Name of the module, such as ``xarray``.
    purpose
        What needs it, such as ``Frf.to_xarray``, for the message.
    extra
        Extra of the package that brings it, for the message.

    Raises
    ------
    InputError
        It is not installed.

    Examples
    --------
    >>> optional_library("no_such_library", "Frf.to_xarray")
    Traceback (most recent call last):
    foundation.errors.InputError: Frf.to_xarray needs no_such_library: pip install "millfrf[notebook]"
    """
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name != name:
            raise
        raise InputError(f'{purpose} needs {name}: pip install "millfrf[{extra}]"') from error
