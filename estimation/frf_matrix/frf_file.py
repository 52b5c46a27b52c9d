"""FRF files: HDF5, format ``millfrf.frf`` version 1, readable with any HDF5 tool."""

import io
import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from foundation import FileFormatError, InputError, conversion_advice, writing_whole_file

from .frf import Frf, FrfCovariance

FORMAT = "millfrf.frf"
FORMAT_VERSION = 1


def write_frf(path: str | os.PathLike[str], frf: Frf, *, title: str = "", provenance: str = "") -> None:
    """Write an FRF whole.

    Root attributes ``format, format_version, title, provenance, quantity, unit, responses, excitations`` (JSON
    lists), and where known ``band_hz`` (two numbers), ``exponential_time_constant_s`` and ``spectral_width_hz``;
    datasets ``frequencies`` (Hz), ``values`` (complex), ``valid``, and where known ``multiple_coherence``,
    ``covariance/response``, ``covariance/excitation``, ``coherence`` (of each entry) and ``averages`` (of each entry).

    Raises
    ------
    InputError
        The folder cannot be written to.
    DiskFull
        No room was left.
    """
    described = {"title": title, "provenance": provenance}
    with writing_whole_file(path) as temporary:
        temporary.write_bytes(_image(frf, described))


def _image(frf: Frf, described: Mapping[str, str]) -> bytes:
    """The file's bytes, made in memory.

    On a full disk the HDF5 library loses a table that is flushed when it is let go, says nothing, and crashes the
    program when it ends; what writes plain bytes is told.
    """
    memory = io.BytesIO()
    with h5py.File(memory, "w") as file:
        file.attrs.update({"format": FORMAT, "format_version": FORMAT_VERSION, **described})
        file.attrs.update({"quantity": frf.quantity, "unit": frf.unit})
        file.attrs["responses"] = json.dumps(list(frf.responses))
        file.attrs["excitations"] = json.dumps(list(frf.excitations))
        for name in ("frequencies", "values", "valid"):
            file[name] = getattr(frf, name)
        if frf.band is not None:
            file.attrs["band_hz"] = list(frf.band)
        if frf.exponential_time_constant is not None:
            file.attrs["exponential_time_constant_s"] = frf.exponential_time_constant
        if frf.spectral_width is not None:
            file.attrs["spectral_width_hz"] = frf.spectral_width
        for name in ("multiple_coherence", "coherence", "averages"):
            if getattr(frf, name) is not None:
                file[name] = getattr(frf, name)
        if frf.covariance is not None:
            file["covariance/response"] = frf.covariance.response
            file["covariance/excitation"] = frf.covariance.excitation
    return memory.getvalue()


def read_frf(path: str | os.PathLike[str]) -> Frf:
    """Read what :func:`write_frf` wrote.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        Not HDF5, another format or version, a missing field, or shapes that disagree.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        if advice := conversion_advice(path):
            raise FileFormatError(f"{path} is a file of another program; {advice}") from error
        raise FileFormatError(f"{path} is not an HDF5 file or is damaged; give an FRF file made here") from error
    with file:
        try:
            _check(file.attrs, path)
            return _read(file)
        except FileFormatError:
            raise
        except (KeyError, TypeError, ValueError, AttributeError, OSError, RuntimeError) as error:
            raise FileFormatError(f"{path}: a field is missing or damaged ({error}); estimate anew") from error
        except InputError as error:
            raise FileFormatError(f"{path}: {error}") from error


def _check(attributes: Any, path: object) -> None:
    found = attributes.get("format", "not given")
    if found != FORMAT:
        raise FileFormatError(f"{path} is no FRF: its format is {found!r}, expected {FORMAT!r}; run estimate first")
    version = attributes.get("format_version")
    if version is None or int(version) != FORMAT_VERSION:
        raise FileFormatError(
            f"{path} has format_version {version}, this program reads {FORMAT_VERSION}; use the program that wrote it"
        )


def _read(file: h5py.File) -> Frf:
    covariance = None
    if "covariance" in file:
        covariance = FrfCovariance(file["covariance/response"][:], file["covariance/excitation"][:])
    time_constant, width = (file.attrs.get(name) for name in ("exponential_time_constant_s", "spectral_width_hz"))
    return Frf(
        np.asarray(file["frequencies"][:], dtype=float),
        np.asarray(file["values"][:], dtype=complex),
        tuple(json.loads(file.attrs["responses"])),
        tuple(json.loads(file.attrs["excitations"])),
        str(file.attrs["quantity"]),
        str(file.attrs["unit"]),
        np.asarray(file["valid"][:], dtype=bool),
        _optional(file, "multiple_coherence", float),
        covariance,
        tuple(file.attrs["band_hz"]) if "band_hz" in file.attrs else None,
        _optional(file, "coherence", float),
        _optional(file, "averages", np.int64),
        None if time_constant is None else float(time_constant),
        None if width is None else float(width),
    )


def _optional(file: h5py.File, name: str, kind: type) -> Any:
    return np.asarray(file[name][:], dtype=kind) if name in file else None
