"""Cuts with their verdicts, and the files that keep them with the spectra they were judged by."""

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import FileFormatError, writing_whole_file

from .verdict import ChatterVerdict, CutSpectrum, ForeignTone


@dataclass(frozen=True)
class JudgedCut:
    """A recording of a cut, with its verdict.

    Parameters
    ----------
    name
        Name of the recording's file.
    stated_rpm : rpm
        Spindle speed that the recording or the user states.
    verdict
        Verdict on the cut, see :class:`millfrf.stability.ChatterVerdict`.
    """

    name: str
    stated_rpm: float
    verdict: ChatterVerdict

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why nothing could be concluded, and what else is doubtful; one sentence each."""
        doubts = self.verdict.warnings
        if self.verdict.kind == "inconclusive":
            doubts = (f"inconclusive: {self.verdict.reason}", *doubts)
        found = self.verdict.spindle_speed * 30 / math.pi
        if abs(found / self.stated_rpm - 1) > _SPEED_OFF:
            doubts = (*doubts, f"the spindle turned at {found:.1f} rpm, stated are {self.stated_rpm:.1f} rpm")
        return tuple(f"{self.name}: {doubt}" for doubt in doubts)


FORMAT = "millfrf.chatter"


FORMAT_VERSION = 1


_ARRAYS = ("frequencies", "amplitude", "floor", "order_frequencies", "order_amplitudes")


_NUMBERS = ("deviation", "growth", "frequency", "p_value", "share", "spindle_speed", "drift")


@dataclass(frozen=True)
class KeptCut:
    """A verdict and the spectrum of the channel that shows it best.

    Parameters
    ----------
    cut
        Recording, stated speed and verdict.
    channel
        Name of the channel whose spectrum is kept.
    unit
        Unit of the spectrum.
    spectrum
        Spectrum of that channel, see :class:`millfrf.stability.CutSpectrum`.
    """

    cut: JudgedCut
    channel: str
    unit: str
    spectrum: CutSpectrum


def write_cuts(path: str | os.PathLike[str], kept: Sequence[KeptCut], provenance: Mapping[str, Any]) -> None:
    """Write verdicts and spectra whole; a number that is not known is ``null``.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    content = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "cuts": [_stored(one) for one in kept],
        "provenance": dict(provenance),
    }
    with writing_whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1, allow_nan=False), encoding="utf-8")


def read_cuts(path: str | os.PathLike[str]) -> tuple[KeptCut, ...]:
    """Read what :func:`write_cuts` wrote.

    Raises
    ------
    FileFormatError
        Another format or version, or fields that are missing.
    """
    name = Path(path).name
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"))
        if (content["format"], content["format_version"]) != (FORMAT, FORMAT_VERSION):
            raise FileFormatError(
                f"{name} is {content['format']!r} version {content['format_version']!r}, expected {FORMAT!r} version "
                f"{FORMAT_VERSION}; run millfrf chatter again"
            )
        return tuple(_read(one) for one in content["cuts"])
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise FileFormatError(
            f"{name} holds no verdicts on cuts; run millfrf chatter ... --out {name} again"
        ) from error


def _stored(kept: KeptCut) -> dict[str, Any]:
    verdict, spectrum = kept.cut.verdict, kept.spectrum
    return {
        "recording": kept.cut.name,
        "stated_speed_rpm": kept.cut.stated_rpm,
        "verdict": verdict.kind,
        "reason": verdict.reason,
        "warnings": list(verdict.warnings),
        **{name: _or_null(getattr(verdict, name)) for name in _NUMBERS},
        "foreign_tones": [
            {"frequency": one.frequency, "share": one.share, "name": one.name} for one in verdict.foreign
        ],
        "spectrum": {
            "channel": kept.channel,
            "number": spectrum.channel,
            "unit": kept.unit,
            **{name: [_or_null(float(f"{value:.5g}")) for value in getattr(spectrum, name)] for name in _ARRAYS},
        },
    }


def _read(stored: Mapping[str, Any]) -> KeptCut:
    tones = tuple(ForeignTone(one["frequency"], one["share"], one["name"]) for one in stored["foreign_tones"])
    numbers = {name: _or_nan(stored[name]) for name in _NUMBERS}
    verdict = ChatterVerdict(
        kind=str(stored["verdict"]),
        foreign=tones,
        reason=str(stored["reason"]),
        warnings=tuple(str(one) for one in stored["warnings"]),
        **numbers,
    )
    kept = stored["spectrum"]
    arrays = {name: np.array([_or_nan(value) for value in kept[name]]) for name in _ARRAYS}
    lengths = [len(arrays[name]) for name in _ARRAYS]
    if len(set(lengths[:3])) != 1 or lengths[3] != lengths[4]:
        raise ValueError("a spectrum's columns differ in length")
    cut = JudgedCut(str(stored["recording"]), float(stored["stated_speed_rpm"]), verdict)
    return KeptCut(cut, str(kept["channel"]), str(kept["unit"]), CutSpectrum(int(kept["number"]), **arrays))


def _or_null(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else float(value)


_SPEED_OFF = 0.002  # relative error of the stated speed from which it is told
