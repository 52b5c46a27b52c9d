"""Poles picked by hand: files of candidates and choices, and the fit of a choice."""

import json
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from estimation import Frf
from millfrf.core import Band, Complex, FileFormatError, InputError, mistake_in_words, writing_whole_file

from .frf_fit.fit import fit_picked
from .frf_fit.steady_poles import default_order
from .polyreference import (
    ModalFit,
    fit_warnings,
    flat_lines,
    relative_error,
    status_warnings,
    transfer_delay,
    usable_lines,
    without_delay,
)
from .stabilisation import OnePole, StabilisationChart

_OFFERED_GROUPS_SAME = (
    0.003  # relative distance in the complex plane within which a pole of an order belongs to a group
)


@dataclass(frozen=True)
class CandidateGroup(OnePole):
    """A group of poles of the stabilisation chart, from which a user may pick.

    Parameters
    ----------
    number
        Number of the group, from 1 on, in order of frequency.
    pole : rad/s
        Pole of the group, in the upper half plane.
    n_orders
        Number of orders of the chart that have it.
    taken
        Whether the automatic fit took it for a mode.
    reason
        Reason why it was not taken; empty where it was.
    """

    number: int
    pole: complex
    n_orders: int
    taken: bool
    reason: str = ""


def candidate_groups(fit: ModalFit) -> tuple[CandidateGroup, ...]:
    """Number modes and dropped groups of a fit by frequency.

    Parameters
    ----------
    fit
        Result of :func:`fit_polyreference`.
    """
    poles = [(complex(pole), _orders_near(fit.chart, complex(pole)), True, "") for pole in fit.model.poles]
    poles += [(group.pole, group.n_orders, False, group.reason) for group in fit.dropped if group.pole.real < 0]
    ordered = sorted(poles, key=_frequency)
    return tuple(CandidateGroup(number, *values) for number, values in enumerate(ordered, start=1))


def _orders_near(chart: StabilisationChart, pole: complex) -> int:
    near = np.abs(np.log(chart.poles / pole)) < _OFFERED_GROUPS_SAME
    return len(np.unique(chart.orders[near]))


def _frequency(group: tuple[complex, int, bool, str]) -> float:
    return abs(group[0])


FORMAT, FORMAT_VERSION = "millfrf.poles", 1
_STRICT = ConfigDict(extra="forbid", frozen=True)


class PickedPole(BaseModel):
    """One pole: by frequency and damping ratio, or by the number of a group.

    Parameters
    ----------
    frequency_hz : Hz
        Natural frequency ``|pole| / 2 pi``.
    damping_ratio
        Damping ratio as a ratio, not per cent; 0 to 0.5.
    group
        Number of an offered group, instead of the two.
    """

    model_config = _STRICT
    frequency_hz: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    damping_ratio: Annotated[float, Field(gt=0, lt=0.5, allow_inf_nan=False)] | None = None
    group: Annotated[int, Field(ge=1)] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> "PickedPole":
        given = self.frequency_hz is not None, self.damping_ratio is not None
        if self.group is None and not all(given):
            raise ValueError("give frequency_hz and damping_ratio (a ratio, not per cent), or group")
        if self.group is not None and any(given):
            raise ValueError(f"group = {self.group} names the pole already; leave frequency_hz and damping_ratio out")
        return self


class OfferedGroup(BaseModel):
    """One group that a picker offers.

    Parameters
    ----------
    group
        Number of the group, from 1.
    frequency_hz : Hz
        Natural frequency of the group's pole.
    damping_ratio
        Damping ratio of the group's pole.
    n_orders
        Number of model orders in which it appears.
    taken
        Whether the automatic choice takes it.
    reason
        Why the automatic choice does not take it.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    group: Annotated[int, Field(ge=1)]
    frequency_hz: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    damping_ratio: Annotated[float, Field(gt=0, lt=1, allow_inf_nan=False)]
    n_orders: Annotated[int, Field(ge=0)] = 0
    taken: bool = False
    reason: str = ""

    @property
    def pole(self) -> complex:
        """Pole of the group, rad/s."""
        return _pole(self.frequency_hz, self.damping_ratio)


class PolesFile(BaseModel):
    """The whole file; what a picker needs beside (``band_hz``, ``stabilisation``, ``provenance``) is passed over.

    Parameters
    ----------
    format, format_version
        What the file is; may be left out in a file written by hand.
    poles
        Chosen poles, ``[[poles]]``.
    groups
        Offered groups, where the file holds them itself.
    candidates
        File of candidates beside this one, whose groups are meant.
    band_hz : Hz
        Band of the fit that offered them; passed over here.
    stabilisation, provenance
        What a picker needs beside; passed over here.
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


def read_picked_poles(path: str | os.PathLike[str]) -> NDArray[np.complex128]:
    """Poles (rad/s) that a file names, in its order.

    Groups are those of the file itself, or of the file of candidates that it names, beside it.

    Raises
    ------
    InputError
        No such file, a key that is unknown, missing or out of range, or a group that is not offered.
    FileFormatError
        Neither TOML nor JSON.
    """
    content = _read(Path(path))
    groups = {one.group: one for one in content.groups}
    if content.candidates is not None:
        beside = Path(path).parent / content.candidates
        groups = {one.group: one for one in _read(beside).groups}
    poles = []
    for number, picked in enumerate(content.poles, start=1):
        f, zeta = picked.frequency_hz, picked.damping_ratio
        if picked.group is not None:
            offered = groups.get(picked.group)
            if offered is None:
                raise InputError(f"{Path(path).name}: poles[{number}] {_no_group(picked.group, groups)}")
            f, zeta = offered.frequency_hz, offered.damping_ratio
        assert f is not None
        assert zeta is not None
        poles.append(_pole(f, zeta))
    return np.array(poles, dtype=complex)


def read_pole_groups(path: str | os.PathLike[str]) -> tuple[CandidateGroup, ...]:
    """Groups that a file offers; none where it is a choice only.

    Raises
    ------
    InputError, FileFormatError
        As :func:`read_picked_poles`.
    """
    groups = _read(Path(path)).groups
    return tuple(CandidateGroup(one.group, one.pole, one.n_orders, one.taken, one.reason) for one in groups)


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
        words = error.strerror if isinstance(error, OSError) else "it is no text"
        raise InputError(f"cannot read poles {path}: {words}; check the name") from error
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
    """Write candidates for a picker, with the automatic choice as ``poles``: the file is itself a choice.

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
        "poles": [{"group": one.number} for one in groups if one.taken],
        "groups": [
            {
                "group": one.number,
                "frequency_hz": one.frequency,
                "damping_ratio": one.damping_ratio,
                "n_orders": one.n_orders,
                "taken": one.taken,
                "reason": one.reason,
            }
            for one in groups
        ],
        "stabilisation": dict(stabilisation),
        "provenance": dict(provenance),
    }
    with writing_whole_file(path) as temporary:
        temporary.write_text(json.dumps(content, indent=1, allow_nan=False), encoding="utf-8")


_LARGEST_DAMPING = 0.5
_PICKED_FIT_SAME = 0.05  # distance over damping below which two picked poles are one
PICKED, PICKED_AND_REFINED = "picked poles, kept", "picked poles, refined"
_FAR = 2.0  # half-power bands


def fit_picked_poles(
    frf: Frf, band: Band, poles: Complex, *, refine: bool = False, max_order: int | None = None
) -> ModalFit:
    """Fit vectors and residuals of exactly these poles to the valid lines of an FRF matrix inside ``band`` (Hz).

    Parameters
    ----------
    frf
        FRF to fit: receptance, mobility, accelerance or a transfer.
    band : Hz
        Lowest and highest frequency of the fit.
    poles : (n_modes,), rad/s
        Poles to keep, with positive imaginary part.
    refine
        Whether poles and vectors are refined from there. The count of modes stays; kept poles have no error bars.
    max_order
        Highest order of the stabilisation chart; None: from the number of lines and references.

    Returns
    -------
    ModalFit
        Its status is ``picked poles, kept`` or ``picked poles, refined``.

    Raises
    ------
    InputError
        No pole, a pole outside the band, one that is no vibration, two that are the same, or more than the lines carry.
    """
    inside = usable_lines(frf, band, max_order)
    chosen = checked_poles(poles, band, int(inside.sum()))
    references = min(len(frf.responses), len(frf.excitations))
    order = default_order(int(inside.sum()), references) if max_order is None else max_order
    order = min(order, int(inside.sum()) // 2)
    delay = _delay(frf, band, chosen, inside) if frf.quantity == "transfer" else 0.0
    shown = without_delay(frf, delay) if delay else frf
    fit = fit_picked(shown, inside, band, order, chosen, refine=refine)
    model = replace(fit.model, delay=delay)
    error = relative_error(frf, model, inside)
    chi = fit.chi_square if frf.covariance is not None else float("nan")
    moved = (*status_warnings(fit), *_moved(chosen, model.poles)) if refine else ()
    warnings = (*moved, *fit_warnings(frf, inside, model, band, chi, error))
    status = PICKED_AND_REFINED if refine else PICKED
    return ModalFit(model, fit.chart, (), band, chi, error, warnings, status)


def checked_poles(poles: Complex, band: Band, n_lines: int) -> Complex:
    """The poles in order of frequency.

    Raises
    ------
    InputError
        As :func:`fit_picked_poles`; the message names the pole by its place in the list.
    """
    given = np.asarray(poles, dtype=complex)
    if not len(given):
        raise InputError("no pole was picked; name at least one")
    frequencies, damping = np.abs(given) / (2 * np.pi), -given.real / np.abs(given)
    for number, (f, zeta) in enumerate(zip(frequencies, damping, strict=True), start=1):
        if not band[0] <= f <= band[1]:
            raise InputError(
                f"pole {number} at {f:g} Hz lies outside the band {band[0]:g} to {band[1]:g} Hz; widen the band, or "
                "leave the pole out"
            )
        if not 0 < zeta < _LARGEST_DAMPING or given[number - 1].imag <= 0:
            raise InputError(
                f"pole {number} at {f:g} Hz has a damping ratio of {zeta:g}; a vibration has one above 0 and below "
                f"{_LARGEST_DAMPING:g}: give a ratio, not per cent"
            )
    order = np.argsort(frequencies, kind="stable")
    for first, second in pairwise(order):
        near = abs(np.log(given[first] / given[second]))
        if near < _PICKED_FIT_SAME * max(damping[first], damping[second]):
            a, b = sorted((int(first) + 1, int(second) + 1))
            raise InputError(f"poles {a} and {b} are the same, {frequencies[first]:g} Hz; name each mode once")
    if 2 * len(given) > n_lines:
        raise InputError(f"{len(given)} poles are too many for {n_lines} lines; pick fewer, or widen the band")
    return given[order]


def _moved(picked: Complex, found: Complex) -> tuple[str, ...]:
    """Picked poles that no refined pole stands near any more."""
    distance = np.abs(np.log(picked)[:, None] - np.log(found)[None, :]).min(axis=1)
    far = distance > _FAR * 2 * (-picked.real / np.abs(picked))
    return tuple(
        f"the refinement drives the pole picked at {abs(pole) / (2 * np.pi):.4g} Hz away from there; is it a mode?"
        for pole in picked[far]
    )


def _delay(frf: Frf, band: Band, poles: Complex, inside: NDArray[np.bool_]) -> float:
    """Delay of a transfer beside given poles, s."""
    return transfer_delay(poles, flat_lines(frf, inside), band)
