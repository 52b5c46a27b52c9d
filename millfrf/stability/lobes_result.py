"""`StabilityLobes`: depth limit over spindle speed, all limits at one speed, and their files."""

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from millfrf.core import (
    FileFormatError,
    Index,
    InputError,
    Real,
    Result,
    Summary,
    counted,
    drawing,
    optional_library,
    read_csv,
    write_csv,
)

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes

BIFURCATIONS = ("hopf", "period-doubling", "fold", "none")
NUMERICS = ("verified", "not-verified", "lower-bound", "unresolved")
STATUSES = (*NUMERICS[:-1], "unmeasured", "uncertain", NUMERICS[-1])
BANDS = ("measured", "unmeasured", "not-stated")
MODELS = ("certain", "uncertain", "not-stated")


@dataclass(frozen=True, eq=False, repr=False)
class StabilityLobes(Result):
    """Largest stable axial depth at each spindle speed.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    depth_limits : (n_speeds,), m
        Largest stable axial depth; infinite where the cut is stable at every depth searched, NaN where ``status`` is
        ``unresolved``.
    chatter_frequencies : (n_speeds,), Hz
        Chatter frequency at the limit; NaN exactly where ``bifurcations`` is ``none``.
    bifurcations
        Kind of instability at each speed: ``hopf``, ``period-doubling``, ``fold`` or ``none``.
    method
        Name of the solver: ``zero-order``, ``nyquist`` ...
    warnings
        Warnings about the limits; one sentence each.
    status
        Reliability of each limit: ``numerics``, but ``unmeasured`` where ``band`` is and a depth is known, and
        ``uncertain`` instead of ``verified`` where ``model`` is. Empty: ``not-verified`` at every speed.
    numerics
        Reliability of each limit for the given structure. ``verified``: Floquet multipliers agree below the limit,
        above it and on a ladder of depths beneath it (or up to the largest depth, where there is no limit).
        ``not-verified``: the solver's result alone. ``lower-bound``: cuts up to this depth are stable; the limit itself
        was not found. ``unresolved``: the depth is NaN, nothing is known. Empty: as ``status``.
    band
        Whether each limit rests on measured dynamics. ``measured``: modes outside the measured band, within their bound
        (:func:`unmeasured_dynamics`), move the limit by less than 5 %. ``unmeasured``: they may move it more.
        ``not-stated``: the structure states no band. Empty: ``not-stated``.
    model
        Whether the structure's own errors leave each limit ``certain``, with a 95 % interval within 7 % of it
        (:func:`with_model`), or ``uncertain``, as also where edge forces lower limits by more
        (:func:`uncertain_by_edge_ends`). ``not-stated``: its errors are not known. Empty: ``not-stated``.
    """

    spindle_speeds: Real
    depth_limits: Real
    chatter_frequencies: Real
    bifurcations: tuple[str, ...]
    method: str
    warnings: tuple[str, ...] = ()
    status: tuple[str, ...] = ()
    numerics: tuple[str, ...] = ()
    band: tuple[str, ...] = ()
    model: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        count = len(self.spindle_speeds)
        object.__setattr__(self, "status", self.status or ("not-verified",) * count)
        object.__setattr__(self, "numerics", self.numerics or self.status)
        object.__setattr__(self, "band", self.band or ("not-stated",) * count)
        object.__setattr__(self, "model", self.model or ("not-stated",) * count)
        columns = (self.spindle_speeds, self.depth_limits, self.chatter_frequencies, self.bifurcations, self.status)
        lengths = {len(column) for column in (*columns, self.numerics, self.band, self.model)}
        if len(lengths) != 1:
            raise InputError(f"stability lobes: columns of unequal lengths {sorted(lengths)}")
        if unknown := set(self.status) - set(STATUSES):
            raise InputError(f"stability lobes: unknown status {sorted(unknown)}; use one of {STATUSES}")
        if unknown := set(self.bifurcations) - set(BIFURCATIONS):
            raise InputError(f"stability lobes: unknown bifurcation {sorted(unknown)}; use one of {BIFURCATIONS}")
        if unknown := set(self.band) - set(BANDS):
            raise InputError(f"stability lobes: unknown band {sorted(unknown)}; use one of {BANDS}")
        if unknown := set(self.model) - set(MODELS):
            raise InputError(f"stability lobes: unknown model {sorted(unknown)}; use one of {MODELS}")

    @property
    def spindle_speeds_rpm(self) -> Real:
        """Spindle speeds in revolutions per minute."""
        return self.spindle_speeds * 60 / (2 * np.pi)

    def plot(self, axes: "Axes | None" = None, *, label: str | None = None) -> "Axes":
        """Draw the depth limits over spindle speed and return the axes; see ``draw_lobes``."""
        return drawing("draw_lobes")(self, axes, label=label)

    def to_frame(self) -> "pandas.DataFrame":
        """Return a pandas table with one row per spindle speed and the columns of the lobes file."""
        columns = (
            self.spindle_speeds_rpm,
            self.depth_limits,
            self.chatter_frequencies,
            list(self.bifurcations),
            list(self.status),
            list(self.numerics),
            list(self.band),
            list(self.model),
        )
        return optional_library("pandas", "StabilityLobes.to_frame").DataFrame(
            dict(zip(LOBES_COLUMNS, columns, strict=True))
        )

    def _summary(self) -> Summary:
        rpm, known = self.spindle_speeds_rpm, np.isfinite(self.depth_limits)
        speed_range = f", {rpm.min():.5g} to {rpm.max():.5g} rpm" if len(rpm) else ""
        counts = [f"{self.status.count(name)} {name}" for name in STATUSES if name in self.status]
        lowest = "no depth limit at any speed"
        if known.any():
            row = int(np.where(known, self.depth_limits, np.inf).argmin())
            lowest = f"lowest limit {1e3 * self.depth_limits[row]:.4g} mm at {rpm[row]:.5g} rpm"
            lowest += f", {self.bifurcations[row]}, {self.status[row]}"
        warnings = f"; {counted(len(self.warnings), 'warning')}" if self.warnings else ""
        columns = (rpm, 1e3 * self.depth_limits, self.chatter_frequencies, self.bifurcations, self.status)
        rows = tuple(
            (f"{speed:.5g}", f"{depth:.4g}", f"{chatter:.4g}", kind, status)
            for speed, depth, chatter, kind, status in zip(*columns, strict=True)
        )
        return Summary(
            f"StabilityLobes: {self.method}, {counted(len(rpm), 'spindle speed')}{speed_range}",
            (lowest, f"status: {', '.join(counts) or 'none'}{warnings}"),
            ("speed (rpm)", "depth limit (mm)", "chatter (Hz)", "bifurcation", "status"),
            rows,
        )


@dataclass(frozen=True)
class StabilityLimits:
    """All crossings of the unit circle below a largest depth, sorted by speed and then by depth.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
        Speeds that were searched, whether or not they have a limit.
    max_depth : m
        Largest depth that was searched.
    speed : (n_limits,)
        Index of each limit's speed in ``spindle_speeds``.
    depth : (n_limits,), m
        Axial depth of each limit.
    frequency : (n_limits,), Hz
        Frequency of the strongest line of the tool's motion at the limit.
    bifurcation
        ``hopf``, ``period-doubling`` or ``fold`` for each limit.
    change : (n_limits,)
        Change of the number of unstable multipliers just above the depth: 2 or -2 (Hopf), 1 or -1 (the other two).
    error : (n_limits,), m
        Estimated numerical error of the depth.
    method
        Name of the solver.
    warnings
        Warnings about the limits, one sentence each.
    resolved : (n_speeds,), m
        Depth up to which the search is complete; infinite if it is complete up to ``max_depth``. Empty: complete at
        every speed.
    """

    spindle_speeds: Real
    max_depth: float
    speed: Index
    depth: Real
    frequency: Real
    bifurcation: tuple[str, ...]
    change: Index
    error: Real
    method: str
    warnings: tuple[str, ...] = ()
    resolved: Real = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        if not len(self.resolved):
            object.__setattr__(self, "resolved", np.full(len(self.spindle_speeds), np.inf))

    def lowest(self) -> StabilityLobes:
        """Return the lowest limit at each speed: below it every cut is stable.

        If the search is complete only up to a smaller depth, this depth is returned as a lower bound.
        """
        depths = np.full(len(self.spindle_speeds), np.inf)
        frequencies = np.full(len(self.spindle_speeds), np.nan)
        kinds = np.full(len(self.spindle_speeds), "none", dtype=object)
        present, first = np.unique(self.speed, return_index=True)
        depths[present], frequencies[present] = self.depth[first], self.frequency[first]
        kinds[present] = [self.bifurcation[limit] for limit in first]
        bounded = (self.resolved < depths) & (self.resolved < self.max_depth)
        depths[bounded], frequencies[bounded], kinds[bounded] = self.resolved[bounded], np.nan, "none"
        status = tuple(np.where(bounded, "lower-bound", "not-verified").tolist())
        warnings = self.warnings
        if bounded.any():
            warnings += (
                f"at {bounded.sum()} of {len(depths)} speeds the search is complete only up to the depth given, which "
                "is a lower bound",
            )
        return StabilityLobes(
            self.spindle_speeds, depths, frequencies, tuple(kinds.tolist()), self.method, warnings, status
        )

    def unstable_multipliers(self, depths: Real) -> Index:
        """Return the number of unstable multipliers at each speed and depth, (n_speeds, n_depths); zero: stable cut."""
        depths = np.asarray(depths, dtype=float)
        total = np.zeros((len(self.spindle_speeds), len(depths)), dtype=np.int64)
        above = np.where(depths[None, :] > self.depth[:, None], self.change[:, None], 0)
        np.add.at(total, self.speed, above)
        return total

    def stable_intervals(self, speed: int) -> list[tuple[float, float]]:
        """Return the intervals of depth (m) in which cuts are stable, lowest first; ``speed`` is an index."""
        rows = self.speed == speed
        edges = np.concatenate([[0.0], self.depth[rows], [self.max_depth]])
        unstable = np.concatenate([[0], np.cumsum(self.change[rows])])
        return [(float(a), float(b)) for a, b, n in zip(edges, edges[1:], unstable, strict=False) if n == 0]


LOBES_COLUMNS = (
    "spindle_speed_rpm",
    "depth_limit_m",
    "chatter_frequency_hz",
    "bifurcation",
    "status",
    "numerics",
    "band",
    "model",
)
# of files written before limits had a status, and before it contained the band and the errors of the model
OLDER_COLUMNS = (LOBES_COLUMNS[:4], LOBES_COLUMNS[:5], LOBES_COLUMNS[:7])


def write_lobes(path: str | os.PathLike[str], lobes: StabilityLobes, *, provenance: str = "") -> None:
    """Write a CSV file with one row per speed; a depth without limit is ``INF`` and its frequency empty.

    Parameters
    ----------
    path
        Lobes file to write, CSV.
    lobes
        Limits to write; their warnings are written into the side file, see :func:`millfrf.core.write_csv`.
    provenance
        Sources and versions as JSON, written into the side file; empty: none.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    columns = (lobes.spindle_speeds_rpm, lobes.depth_limits, lobes.chatter_frequencies)
    words = (lobes.bifurcations, lobes.status, lobes.numerics, lobes.band, lobes.model)
    rows = [
        (f"{rpm:.10g}", f"{depth:.8g}", frequency, *texts)
        for rpm, depth, frequency, *texts in zip(*columns, *words, strict=True)
    ]
    write_csv(
        path, LOBES_COLUMNS, rows, warnings=lobes.warnings, provenance=json.loads(provenance) if provenance else None
    )


def read_lobes(path: str | os.PathLike[str]) -> StabilityLobes:
    """Read a file that :func:`write_lobes` wrote.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        Other columns, a value that is no number, or a speed or depth that is not positive.
    """
    table = read_csv(path)
    if table.columns not in (LOBES_COLUMNS, *OLDER_COLUMNS):
        raise FileFormatError(
            f"{path} has columns {', '.join(table.columns)}, lobes have {', '.join(LOBES_COLUMNS)}; give a file that "
            "lobes wrote"
        )
    try:
        return _lobes([table.columns, *table.rows], table.warnings)
    except InputError as error:
        raise FileFormatError(f"{path} is not a table of lobes: {error}") from error


def _lobes(rows: Sequence[Sequence[str]], warnings: tuple[str, ...]) -> StabilityLobes:
    for number, row in enumerate(rows[1:], 1):
        if len(row) != len(rows[0]):
            raise InputError(f"row {number} has {len(row)} entries, not {len(rows[0])}; write the lobes anew")
    columns = list(zip(*rows[1:], strict=True)) or [()] * len(LOBES_COLUMNS)
    speeds, depths, frequencies = (_numbers(columns[i], LOBES_COLUMNS[i]) for i in range(3))
    for name, values in zip(LOBES_COLUMNS, (speeds, depths), strict=False):
        if (values <= 0).any():
            raise InputError(f"{name} = {values[values <= 0][0]:g} must be above 0; write the lobes anew")
    words = [tuple(column) for column in columns[3:]]
    speeds = speeds * 2 * np.pi / 60
    return StabilityLobes(speeds, depths, frequencies, words[0], "file", warnings, *words[1:])


def _numbers(texts: Sequence[str], name: str) -> Real:
    """Convert the entries of a column to numbers; an empty entry is NaN."""
    values = np.full(len(texts), np.nan)
    for i, text in enumerate(texts):
        if text:
            try:
                values[i] = float(text)
            except ValueError as error:
                raise InputError(f"{name} = {text!r} in row {i + 1} is no number; write the lobes anew") from error
    return values
