"""Comparison of lobes files with the certified limits of the structures among the files."""

from dataclasses import dataclass

import numpy as np

from estimation import Frf, to_receptance
from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess
from millfrf.stability import StabilityLobes, certified_lobes, zero_order
from modal_fit import ModalModel

from .collection import Collected, SourceFile

SAMPLE_SPEEDS = 9  # speeds at which the structure and method of a file are identified
SAME_LIMITS = 0.002  # median relative difference up to which limits belong to a structure
CERTAIN = 1e-5  # median relative difference below which no other structure is tried
DIFFERS = 0.03  # relative difference from the certified limit that causes a warning

CERTIFIED, AVERAGED, UNKNOWN = "time-periodic", "averaged coefficients (zero-order)", "unknown method"


@dataclass(frozen=True)
class CheckedLobes:
    """A lobes file, with the structure and method of its limits.

    Parameters
    ----------
    file, given
        The file and its limits.
    method
        ``time-periodic``, ``averaged coefficients (zero-order)`` or ``unknown method``.
    structure
        File and structure of the limits; None: no structure among the files gives them.
    process
        Milling process of the limits.
    certified
        Certified limits of that structure at the file's speeds; None without a structure.
    max_depth
        Largest depth of the search, m.
    """

    file: SourceFile
    given: StabilityLobes
    method: str = UNKNOWN
    structure: tuple[SourceFile, ModalModel | Frf] | None = None
    process: MillingProcess | None = None
    certified: StabilityLobes | None = None
    max_depth: float = 0.0

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
        rank = (CERTIFIED, UNKNOWN, AVERAGED).index(self.method)
        return rank, -float(np.mean([status == "verified" for status in self.given.status]))

    @property
    def headline(self) -> tuple[str, StabilityLobes]:
        """Name and limits for the head of the page: the certified limits if the file's limits differ from them."""
        if self.certified is not None and self.wrong:
            return f"{self.file.label}, certified", self.certified
        return self.file.label, self.given


def checked_lobes(collected: Collected) -> tuple[CheckedLobes, ...]:
    """Check every lobes file, and sort them by exactness."""
    checked = [_checked(collected, file, lobes) for file, lobes in collected.lobes]
    return tuple(sorted(checked, key=lambda lobes: lobes.exactness))


def lobes_warnings(checked: tuple[CheckedLobes, ...], collected: Collected) -> list[str]:
    """Return warnings about limits that differ from the certified limits, and about limits that were not checked."""
    warnings = []
    for one in checked:
        if one.certified is None:
            if _structures(collected) and collected.cutting:
                warnings.append(
                    f"{one.file.path.name}: its limits belong to no structure and cut among the files and could not be "
                    "checked; give the model or FRF and the cutting file that they were computed from"
                )
        elif one.wrong:
            warnings.append(_wrong(one))
    return warnings


def _wrong(one: CheckedLobes) -> str:
    assert one.certified is not None
    assert one.structure is not None
    apart = one.differences
    worst = int(np.argmax(np.where(np.isnan(apart), -1.0, apart)))
    if apart[worst] <= DIFFERS:
        worst = int(np.nanargmax(np.abs(apart)))
    count = int((np.abs(apart) > DIFFERS).sum())
    return (
        f"{one.file.path.name} ({one.method}) is not the stability limit of {one.structure[0].path.name}: at "
        f"{one.given.spindle_speeds_rpm[worst]:.0f} rpm it states {_depth(one.given, worst)}, the certified limit is "
        f"{_depth(one.certified, worst)}; {count} of {len(apart)} speeds differ by more than {100 * DIFFERS:.0f} %. "
        "The report uses the certified limits; compute the lobes again without --method"
    )


def _depth(lobes: StabilityLobes, k: int) -> str:
    depth = lobes.depth_limits[k]
    if np.isnan(depth):
        return "not resolved"
    if np.isinf(depth):
        return "no limit"
    kind = " by period doubling" if lobes.bifurcations[k] == "period-doubling" else ""
    return f"{1e3 * depth:.2f} mm{kind}"


def _structures(collected: Collected) -> list[tuple[SourceFile, ModalModel | Frf]]:
    """Return the models and FRFs among the files from which lobes can be computed."""
    usable: list[tuple[SourceFile, ModalModel | Frf]] = [*collected.models]
    for file, frf in collected.frfs:
        try:
            usable.append((file, to_receptance(frf)))
        except InputError:  # a transfer
            continue
    return usable


def _checked(collected: Collected, file: SourceFile, lobes: StabilityLobes) -> CheckedLobes:
    finite = lobes.depth_limits[np.isfinite(lobes.depth_limits)]
    if not len(finite):
        return CheckedLobes(file, lobes)
    deepest = float(finite.max())
    few = np.unique(np.linspace(0, len(lobes.spindle_speeds) - 1, SAMPLE_SPEEDS).round().astype(int))
    best: tuple[float, str, tuple[SourceFile, ModalModel | Frf], MillingProcess] | None = None
    for _, process in collected.cutting:
        for structure in _structures(collected):
            for method, solver in ((CERTIFIED, certified_lobes), (AVERAGED, zero_order)):
                if best is not None and best[0] < CERTAIN:
                    break
                try:
                    again = solver(structure[1], process, lobes.spindle_speeds[few], 1.01 * deepest)
                except InputError:  # another point of the structure, or a cut that the solver does not take
                    continue
                apart = _differences(lobes.depth_limits[few], again.depth_limits, deepest)
                distance = float(np.nanmedian(np.abs(apart))) if np.isfinite(apart).any() else np.inf
                if distance < SAME_LIMITS and (best is None or distance < best[0]):
                    best = (distance, method, structure, process)
    if best is None:
        return CheckedLobes(file, lobes)
    _, method, structure, process = best
    certified = certified_lobes(structure[1], process, lobes.spindle_speeds, 1.01 * deepest)
    return CheckedLobes(file, lobes, method, structure, process, certified, deepest)


def _differences(given: Real, certified: Real, deepest: float) -> Real:
    """Return ``given / certified - 1``, with both limited to the largest depth of the search."""
    return np.asarray(np.minimum(given, deepest) / np.minimum(certified, deepest) - 1)
