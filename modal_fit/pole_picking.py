"""Poles picked by hand: candidates, and the files that offer and name them."""

import json
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from millfrf.core import Band, Complex, FileFormatError, InputError, mistake_in_words, writing_whole_file

from .polyreference import ModalFit
from .settings import SETTINGS
from .stabilisation import PoleMixin, StabilisationChart

FORMAT, FORMAT_VERSION = "millfrf.poles", 1
_STRICT = ConfigDict(extra="forbid", frozen=True)


@dataclass(frozen=True)
class CandidateGroup(PoleMixin):
    """A group of poles of the stabilisation chart, from which a user may pick.

    Parameters
    ----------
    number
        Number of the group, from 1 on, in order of frequency.
    pole : rad/s
        Pole of the group, in the upper half plane.
    n_orders
        Number of orders of the chart in which the group was found.
    taken
        Whether the group is a mode of the automatic fit.
    reason
        Reason why the automatic fit does not take the group as a mode; empty where it does.
    """

    number: int
    pole: complex
    n_orders: int
    taken: bool
    reason: str = ""

    def content(self) -> dict[str, Any]:
        """Return the entries of the group in a file of poles."""
        return {
            "group": self.number,
            "frequency_hz": self.frequency,
            "damping_ratio": self.damping_ratio,
            "n_orders": self.n_orders,
            "taken": self.taken,
            "reason": self.reason,
        }


def candidate_groups(fit: ModalFit) -> tuple[CandidateGroup, ...]:
    """Number modes and dropped groups of a fit by frequency.

    Parameters
    ----------
    fit
        Result of :func:`fit_polyreference`.
    """
    poles = [(complex(pole), _orders_near(fit.chart, complex(pole)), True, "") for pole in fit.model.poles]
    poles += [(group.pole, group.n_orders, False, group.reason) for group in fit.dropped if group.pole.real < 0]
    ordered = sorted(poles, key=lambda group: abs(group[0]))
    return tuple(CandidateGroup(number, *values) for number, values in enumerate(ordered, start=1))


def _orders_near(chart: StabilisationChart, pole: complex) -> int:
    near = np.abs(np.log(chart.poles / pole)) < SETTINGS.offered_group_distance
    return len(np.unique(chart.orders[near]))


class PickedPole(BaseModel):
    """One picked pole, given by frequency and damping ratio or by the number of a group.

    Parameters
    ----------
    frequency_hz : Hz
        Natural frequency ``|pole| / 2 pi``.
    damping_ratio
        Damping ratio as a ratio, not per cent; 0 to 0.5.
    group
        Number of an offered group, instead of frequency and damping ratio.
    """

    model_config = _STRICT
    frequency_hz: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    damping_ratio: Annotated[float, Field(gt=0, lt=0.5, allow_inf_nan=False)] | None = None
    group: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> "PickedPole":
        present = self.frequency_hz is not None, self.damping_ratio is not None
        if self.group is None and not all(present):
            raise ValueError("give frequency_hz and damping_ratio (a ratio, not per cent), or group")
        if self.group is not None and any(present):
            raise ValueError(f"group = {self.group} names the pole already; leave frequency_hz and damping_ratio out")
        return self


class OfferedGroup(BaseModel):
    """One group of poles that a poles file offers to pick from.

    Parameters
    ----------
    group
        Number of the group, from 1.
    frequency_hz : Hz
        Natural frequency of the group's pole.
    damping_ratio
        Damping ratio of the group's pole.
    n_orders
        Number of model orders in which the group was found.
    taken
        Whether the automatic fit takes the group as a mode.
    reason
        Reason why the automatic fit does not take the group.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    group: Annotated[int, Field(ge=1)]
    frequency_hz: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    damping_ratio: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)]
    n_orders: Annotated[int, Field(ge=0)] = 0
    taken: bool = False
    reason: str = ""


class PolesFile(BaseModel):
    """Content of a poles file; ``band_hz``, ``stabilisation`` and ``provenance`` serve a picker and are not read here.

    Parameters
    ----------
    format, format_version
        Kind and version of the file; may be left out in a file written by hand.
    poles
        Chosen poles, ``[[poles]]``.
    groups
        Offered groups, where the file holds them itself.
    candidates
        File of candidates in the same folder, to whose groups the poles refer.
    band_hz : Hz
        Band of the fit that offered the groups; not read here.
    stabilisation, provenance
        Chart and sources for a picker; not read here.
    """

    model_config = _STRICT
    format: Literal["millfrf.poles"] = "millfrf.poles"
    format_version: Literal[1] = 1
    poles: Annotated[tuple[PickedPole, ...], Field(min_length=1)]
    groups: tuple[OfferedGroup, ...] = ()
    candidates: str | None = None
    band_hz: tuple[float, float] | None = None
    stabilisation: dict[str, Any] | None = None
    provenance: dict[str, Any] | None = None


def read_picked_poles(path: str | os.PathLike[str]) -> Complex:
    """Read the poles (rad/s) that a file names, in its order.

    Numbers of groups refer to the file itself, or to the file of candidates in the same folder that it names.

    Raises
    ------
    InputError
        No such file, a key that is unknown, missing or out of range, or a group that is not offered.
    FileFormatError
        Neither TOML nor JSON.
    """
    content = _read(Path(path))
    offering = content if content.candidates is None else _read(Path(path).parent / content.candidates)
    groups = {offered.group: offered for offered in offering.groups}
    poles = []
    for number, picked in enumerate(content.poles, start=1):
        f, zeta = picked.frequency_hz, picked.damping_ratio
        if picked.group is not None:
            if picked.group not in groups:
                raise InputError(f"{Path(path).name}: poles[{number}] {_no_group(picked.group, groups)}")
            f, zeta = groups[picked.group].frequency_hz, groups[picked.group].damping_ratio
        assert f is not None
        assert zeta is not None
        poles.append(_pole(f, zeta))
    return np.array(poles, dtype=complex)


def read_pole_groups(path: str | os.PathLike[str]) -> tuple[CandidateGroup, ...]:
    """Read the groups that a file offers; none where it only names poles.

    Raises
    ------
    InputError, FileFormatError
        As :func:`read_picked_poles`.
    """
    return tuple(
        CandidateGroup(g.group, _pole(g.frequency_hz, g.damping_ratio), g.n_orders, g.taken, g.reason)
        for g in _read(Path(path)).groups
    )


def _pole(f: float, zeta: float) -> complex:
    return complex(2 * np.pi * f * (-zeta + 1j * np.sqrt(1 - zeta**2)))


def _no_group(number: int, groups: Mapping[int, OfferedGroup]) -> str:
    if not groups:
        return (
            f"names group {number}, but no groups are offered: as candidates name the file that write_pole_candidates "
            "('millfrf fit --candidates') wrote, or give frequency_hz and damping_ratio"
        )
    return f"names group {number}; there are groups {min(groups)} to {max(groups)}"


def _read(path: Path) -> PolesFile:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        raise InputError(f"cannot read poles {path}: {reason}; check the name") from error
    try:
        content = json.loads(text) if text.lstrip().startswith("{") else tomllib.loads(text)
    except (json.JSONDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise FileFormatError(f"poles {path} are neither TOML nor JSON: {error}; write [[poles]] tables") from error
    if not isinstance(content, dict) or content.get("format", FORMAT) != FORMAT:
        raise FileFormatError(f"{path} holds no poles; expected format {FORMAT!r}, or [[poles]] tables")
    try:
        return PolesFile.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{path.name}: {mistake_in_words(error, PolesFile)}") from error


def write_pole_candidates(
    path: str | os.PathLike[str],
    groups: Sequence[CandidateGroup],
    band: Band,
    stabilisation: Mapping[str, Any],
    provenance: Mapping[str, Any],
) -> None:
    """Write candidate groups for a picker.

    The automatic choice is written as ``poles``, so that the file can also be read as picked poles.

    Parameters
    ----------
    path
        File to write, ``.json``.
    groups
        Candidates, from :func:`candidate_groups`.
    band : Hz
        Lowest and highest frequency of the fit.
    stabilisation
        The chart as lists, for a picker to draw.
    provenance
        Sources and versions behind the candidates.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    content = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "band_hz": list(band),
        "poles": [{"group": group.number} for group in groups if group.taken],
        "groups": [group.content() for group in groups],
        "stabilisation": dict(stabilisation),
        "provenance": dict(provenance),
    }
    with writing_whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1, allow_nan=False), encoding="utf-8")
