"""Comparison of lobes files with the certified limits of the structures among the files, and islands."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import InputError, Real
from millfrf.core.content_hashes import accepts_edited
from millfrf.cutting import MillingProcess
from millfrf.figures import StableAbove
from millfrf.stability import (
    StabilityLobes,
    certified_lobes,
    certified_numerics,
    collocation_limits,
    depth_errors,
    multi_frequency_limits,
    with_workpiece,
    zero_order,
)
from modal_fit import ModalModel

from .collection import Collected, SourceFile

COMPARED_SPEEDS = 15  # speeds at which limits of a model and of its FRF are compared
SAMPLE_SPEEDS = 9  # speeds at which the structure and method of a file are identified
SAME_LIMITS = 0.002  # median relative difference up to which limits belong to a structure
CERTAIN = 1e-5  # median relative difference below which no other structure is tried
DIFFERS = 0.03  # relative difference from the certified limit that causes a warning

CERTIFIED, AVERAGED, UNKNOWN = "time-periodic", "averaged coefficients (zero-order)", "unknown method"
VARIED = "varied speed"


@dataclass(frozen=True)
class CheckedLobes:
    """A lobes file, with the structure and method of its limits.

    Parameters
    ----------
    file, given
        The file and its limits.
    method
        ``time-periodic``, ``averaged coefficients (zero-order)``, ``varied speed`` or ``unknown method``.
    structure
        File and structure of the limits; None: no structure among the files gives them.
    process
        Milling process of the limits.
    certified
        Certified limits of that structure at the file's speeds; None without a structure.
    max_depth
        Largest depth of the search, m.
    frf
        Comparison with the FRF to which the structure was fitted; None: it is not among the files.
    """

    file: SourceFile
    given: StabilityLobes
    method: str = UNKNOWN
    structure: tuple[SourceFile, ModalModel | Frf] | None = None
    process: MillingProcess | None = None
    certified: StabilityLobes | None = None
    max_depth: float = 0.0
    frf: "FrfComparison | None" = None

    @property
    def differences(self) -> Real:
        """Relative difference of the file's limits from the certified limits; NaN where either limit is not known."""
        if self.certified is None:
            return np.zeros(len(self.given.depth_limits))
        return _differences(self.given.depth_limits, self.certified.depth_limits, self.max_depth)

    @property
    def wrong(self) -> bool:
        """Return whether any limit of the file differs from the certified limit by more than 3 %."""
        return bool((np.abs(self.differences) > DIFFERS).any())

    @property
    def exactness(self) -> tuple[int, float]:
        """Sorting key by method (time-periodic, unknown, averaged), then by falling share of verified limits."""
        rank = (CERTIFIED, UNKNOWN, AVERAGED, VARIED).index(self.method)
        return rank, -float(np.mean([status == "verified" for status in self.given.numerics]))

    @property
    def headline(self) -> tuple[str, StabilityLobes]:
        """Name and limits for the head of the page: the certified limits if the file's limits differ from them."""
        if self.certified is not None and self.wrong:
            return f"{self.file.label}, certified", self.certified
        return f"{self.file.label}, varied speed" if self.method == VARIED else self.file.label, self.given


@dataclass(frozen=True)
class FrfComparison:
    """Limits of a fitted model and of the FRF to which it was fitted, at some speeds.

    Parameters
    ----------
    file, frf
        File of the FRF, and the FRF as receptance.
    spindle_speeds : (n_speeds,), rad/s
        Speeds that are compared.
    model, measured : (n_speeds,), m
        Limits of the model and of the FRF, at most the largest depth; NaN where one is not known.
    error : (n_speeds,), m
        Two standard errors of the difference, plus the numerical error of the FRF's limit.
    found : (n_speeds,)
        Whether the FRF has a limit up to the largest depth.
    """

    file: SourceFile
    frf: Frf
    spindle_speeds: Real
    model: Real
    measured: Real
    error: Real
    found: NDArray[np.bool_]

    @property
    def gaps(self) -> NDArray[np.bool_]:
        """Return the speeds at which the FRF has a limit and the model's differs by more than its error and 3 %.

        Without a limit of the FRF there is no error of it either: its lines end where a model goes on.
        """
        with np.errstate(invalid="ignore"):
            size = np.abs(self.model - self.measured)
            differs = (size > self.error) & (size > DIFFERS * np.minimum(self.model, self.measured))
        return np.asarray(differs & self.found)


def checked_lobes(collected: Collected) -> tuple[CheckedLobes, ...]:
    """Check every lobes file, and sort them by exactness."""
    checked = [_checked(collected, file, lobes) for file, lobes in collected.lobes]
    return tuple(sorted(checked, key=lambda lobes: lobes.exactness))


def lobes_warnings(checked: tuple[CheckedLobes, ...], collected: Collected) -> list[str]:
    """Return warnings about limits that differ from the certified limits, and about limits that were not checked."""
    warnings = []
    for check in checked:
        if check.method == VARIED:
            warnings.append(
                f"{check.file.path.name}: its limits hold at a varied spindle speed and are not compared; bands and "
                "recommended cuts are for constant speed"
            )
        elif check.certified is None:
            if _structures(collected) and collected.cutting:
                warnings.append(
                    f"{check.file.path.name}: its limits belong to no structure and cut among the files and could not "
                    "be checked; give the model or FRF and the cutting file that they were computed from"
                )
        elif check.wrong:
            warnings.append(_wrong(check))
        if check.frf is not None and check.frf.gaps.any():
            warnings.append(_gap(check, check.frf))
    return warnings


def _gap(check: CheckedLobes, compared: FrfComparison) -> str:
    assert check.structure is not None
    gaps = compared.gaps
    ratio = np.log(np.where(gaps, compared.model, 1.0) / np.where(gaps, compared.measured, 1.0))
    worst = int(np.argmax(np.abs(ratio)))

    def shown(depth: float) -> str:
        return f"no limit up to {1e3 * check.max_depth:.3g} mm" if depth >= check.max_depth else f"{1e3 * depth:.3g} mm"

    return (
        f"{check.structure[0].path.name} and {compared.file.path.name}, to which it was fitted, have different limits "
        f"at {int(gaps.sum())} of {len(gaps)} speeds: at {compared.spindle_speeds[worst] * 30 / np.pi:.0f} rpm the "
        f"model has {shown(compared.model[worst])}, the FRF {shown(compared.measured[worst])}, with an error of "
        f"{1e3 * compared.error[worst]:.2g} mm; the fit misses a mode, or the FRF errs there by noise, leakage or "
        "modes outside its band: compare model and FRF, then fit again (--modes, another --band) or measure again"
    )


def _wrong(check: CheckedLobes) -> str:
    assert check.certified is not None
    assert check.structure is not None
    apart = check.differences
    worst = int(np.argmax(np.where(np.isnan(apart), -1.0, apart)))
    if apart[worst] <= DIFFERS:
        worst = int(np.nanargmax(np.abs(apart)))
    count = int((np.abs(apart) > DIFFERS).sum())
    return (
        f"{check.file.path.name} ({check.method}) is not the stability limit of {check.structure[0].path.name}: at "
        f"{check.given.spindle_speeds_rpm[worst]:.0f} rpm it states {_depth(check.given, worst)}, the certified limit "
        f"is {_depth(check.certified, worst)}; {count} of {len(apart)} speeds differ by more than "
        f"{100 * DIFFERS:.0f} %. The report uses the certified limits; compute the lobes again without --method"
    )


def _depth(lobes: StabilityLobes, k: int) -> str:
    depth = lobes.depth_limits[k]
    if np.isnan(depth):
        return "not resolved"
    if np.isinf(depth):
        return "no limit"
    kind = " by period doubling" if lobes.bifurcations[k] == "period-doubling" else ""
    return f"{1e3 * depth:.3g} mm{kind}"


def _structures(collected: Collected) -> list[tuple[SourceFile, ModalModel | Frf]]:
    """Return the models and FRFs among the files from which lobes can be computed."""
    usable: list[tuple[SourceFile, ModalModel | Frf]] = [*collected.models]
    for file, frf in collected.frfs:
        try:
            usable.append((file, to_receptance(frf)))
        except InputError:  # a transfer
            continue
    return usable


def _relative(collected: Collected, file: SourceFile) -> list[tuple[SourceFile, ModalModel | Frf]]:
    """Return the tool relative to the workpiece, if both models of a lobes file are among the files."""
    sources = [source.get("sha256") for source in file.provenance.get("sources", [])]
    used = [pair for pair in collected.models if pair[0].sha256 in sources]
    if len(used) != 2:
        return []
    (tool_file, tool), (other, workpiece) = sorted(used, key=lambda pair: sources.index(pair[0].sha256))
    path = tool_file.path.with_name(f"{tool_file.path.name} with {other.path.name}")
    return [(replace(tool_file, path=path, provenance={}), with_workpiece(tool, workpiece))]


def _options(file: SourceFile) -> dict[str, Any]:
    """Return the options in a file's provenance."""
    options = file.provenance.get("options", {})
    return options if isinstance(options, dict) else {}


def _checked(collected: Collected, file: SourceFile, lobes: StabilityLobes) -> CheckedLobes:
    if "variation" in _options(file):
        return CheckedLobes(file, lobes, VARIED)
    few = np.unique(np.linspace(0, len(lobes.spindle_speeds) - 1, SAMPLE_SPEEDS).round().astype(int))
    best: tuple[float, str, tuple[SourceFile, ModalModel | Frf], tuple[SourceFile, MillingProcess]] | None = None
    for cutting in collected.cutting:
        process = cutting[1]
        deepest = searched_depth(file, lobes, process)
        for structure in [*_relative(collected, file), *_structures(collected)]:
            for method, solver in ((CERTIFIED, certified_numerics), (AVERAGED, zero_order)):
                if best is not None and best[0] < CERTAIN:
                    break
                try:
                    again = solver(structure[1], process, lobes.spindle_speeds[few], 1.01 * deepest)
                except InputError:  # another point of the structure, or a cut that the solver does not take
                    continue
                apart = _differences(lobes.depth_limits[few], again.depth_limits, deepest)
                distance = float(np.nanmedian(np.abs(apart))) if np.isfinite(apart).any() else np.inf
                if distance < SAME_LIMITS and (best is None or distance < best[0]):
                    best = (distance, method, structure, cutting)
    if best is None:
        return CheckedLobes(file, lobes)
    distance, method, structure, (cutting_file, process) = best
    deepest = searched_depth(file, lobes, process)
    if distance < CERTAIN and _states_certified(file, structure[0], cutting_file):
        certified = lobes
    else:
        certified = certified_lobes(structure[1], process, lobes.spindle_speeds, 1.01 * deepest)
    compared = _compared(collected, structure, process, certified, deepest)
    return CheckedLobes(file, lobes, method, structure, process, certified, deepest, compared)


def _states_certified(file: SourceFile, structure: SourceFile, cutting: SourceFile) -> bool:
    """Return whether a file states that its limits are the certified ones of exactly these files.

    Its content is the one that was written, unless edited files are accepted.
    """
    stated = file.provenance.get("step") == "lobes" and _options(file).get("method") == "certified"
    return stated and not accepts_edited() and file.made_from(structure) and file.made_from(cutting)


def searched_depth(file: SourceFile, lobes: StabilityLobes, process: MillingProcess | None) -> float:
    """Return the largest depth (m) at which limits of a file were searched.

    It is the option in the file's provenance where a limit is infinite, else the largest limit. A file that states
    neither was searched up to the cutter's diameter, the default of the step; 0 if the cutter is not known.
    """
    stated = _options(file).get("max_depth_m")
    finite = lobes.depth_limits[np.isfinite(lobes.depth_limits)]
    if np.isposinf(lobes.depth_limits).any() or not len(finite):
        if isinstance(stated, int | float) and stated > 0:
            return float(stated)
        if not len(finite):
            return process.diameter if process is not None else 0.0
    return float(finite.max())


def _compared(
    collected: Collected,
    structure: tuple[SourceFile, ModalModel | Frf],
    process: MillingProcess,
    certified: StabilityLobes,
    deepest: float,
) -> FrfComparison | None:
    """Compare limits of a fitted model with those of the FRF to which it was fitted, if this is among the files."""
    file, model = structure
    if not isinstance(model, ModalModel) or file.provenance.get("step") != "fit" or not process.is_plain:
        return None
    for source, frf in _structures(collected):
        if isinstance(frf, Frf) and file.made_from(source) and frf.responses == model.responses:
            break
    else:
        return None
    rows = np.unique(np.linspace(0, len(certified.spindle_speeds) - 1, COMPARED_SPEEDS).round().astype(int))
    speeds = certified.spindle_speeds[rows]
    try:
        limits = multi_frequency_limits(frf, process, speeds, deepest, lowest=True)
    except InputError:  # the FRF's lines do not reach harmonics that the lowest speeds need
        return None
    lobes = limits.lowest()
    errors = known_errors(model, process, certified)[rows], known_errors(frf, process, lobes)
    numerical = np.zeros(len(speeds))
    present, first = np.unique(limits.speed, return_index=True)
    numerical[present] = limits.error[first]
    spread = 2 * np.hypot(*errors) + numerical
    own = np.minimum(certified.depth_limits[rows], deepest)
    measured = np.minimum(lobes.depth_limits, deepest)
    return FrfComparison(source, frf, speeds, own, measured, spread, np.isfinite(lobes.chatter_frequencies))


def known_errors(structure: ModalModel | Frf, process: MillingProcess, lobes: StabilityLobes) -> Real:
    """Return the standard errors of limits (m), 0 where nothing is known of them."""
    try:
        return np.nan_to_num(depth_errors(structure, process, lobes))
    except InputError:  # neither a covariance nor errors of the coefficients
        return np.zeros(len(lobes.depth_limits))


def _differences(given: Real, certified: Real, deepest: float) -> Real:
    """Return ``given / certified - 1``, with both limited to the largest depth of the search."""
    return np.asarray(np.minimum(given, deepest) / np.minimum(certified, deepest) - 1)


def stable_above(
    structure: ModalModel | Frf, process: MillingProcess, lobes: StabilityLobes, max_depth: float
) -> tuple[StableAbove, ...]:
    """Find every range of stable depths with unstable depths below it, at the speeds of the lobes.

    Parameters
    ----------
    structure
        Modal model at the tool tip. For an FRF no range is returned: its band limits the search at larger depths; nor
        for turning, whose revolutions hold too many waves.
    process, lobes
        Milling process, and its lowest limits.
    max_depth : m
        Largest depth of the search.

    Returns
    -------
    tuple of StableAbove
        No range at a speed whose lowest limit differs from that of ``lobes`` by more than 5 %, or whose search is
        not complete.
    """
    if isinstance(structure, Frf) or process.is_turning:
        return ()
    limits = collocation_limits(structure, process, lobes.spindle_speeds, max_depth)
    lowest = limits.lowest().depth_limits
    ranges = []
    for k, speed in enumerate(lobes.spindle_speeds_rpm):
        agreed = np.isfinite(lowest[k]) and abs(lowest[k] - lobes.depth_limits[k]) <= 0.05 * lowest[k]
        if not agreed or limits.resolved[k] < max_depth:
            continue
        ranges += [StableAbove(float(speed), low, high) for low, high in limits.stable_intervals(k) if low > 0]
    return tuple(ranges)
