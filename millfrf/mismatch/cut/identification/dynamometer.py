"""Transfer of a dynamometer, measured over applied force, from taps on it."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimation import Frf, read_frf
from millfrf.core import TIP, Complex, DegreeOfFreedom, InputError, Real

STATIC_SHARE = 0.05  # of the valid lines, the lowest: their median is the static gain
LARGEST_GAIN = 2.0  # static gain, or its inverse, beyond which hammer and dynamometer differ in unit or direction
DOUBTED_GAIN = 0.1  # difference of the static gain from 1 beyond which one of the two sensors is miscalibrated


@dataclass(frozen=True)
class Dynamometer:
    """Transfer ``F_measured = D F_applied`` of a dynamometer with the workpiece on it.

    Parameters
    ----------
    frequencies : (n,), Hz
        Lines, the first at 0 Hz, where D is the identity: the static gain is that of the dynamometer's calibration.
    values : (n, 3, 3)
        Measured along applied force, X, Y, Z.
    variance : (n, 3, 3)
        ``E|dD|^2`` of each entry; 0 where it is not known.
    warnings
        Sentences on directions that were not tapped, and on calibrations that disagree.
    """

    frequencies: Real
    values: Complex
    variance: Real
    warnings: tuple[str, ...]

    @property
    def highest(self) -> float:
        """Highest frequency of the transfer, Hz."""
        return float(self.frequencies[-1])

    def at_orders(self, turning: Real, top: int, axes: tuple[int, ...]) -> tuple[Complex, Real]:
        """Return the transfer at spindle orders, averaged over the speeds of a recording, and its variance.

        Parameters
        ----------
        turning : (n_speeds,), Hz
            Spindle frequencies, each for an equal share of the recording.
        top
            Highest order.
        axes
            Measured axes: 0, 1, 2 for X, Y, Z.

        Returns
        -------
        (top + 1, n_axes, n_axes) each
        """
        at = np.arange(top + 1)[:, None] * turning
        chosen = np.ix_(range(top + 1), axes, axes)
        mean, variance = np.empty((top + 1, 3, 3), complex), np.empty((top + 1, 3, 3))
        for p, q in np.ndindex(3, 3):
            mean[:, p, q] = np.interp(at, self.frequencies, self.values[:, p, q]).mean(axis=1)
            variance[:, p, q] = np.interp(at, self.frequencies, self.variance[:, p, q]).mean(axis=1)
        return mean[chosen], variance[chosen]


def read_dynamometer(path: str | os.PathLike[str]) -> Dynamometer:
    """Read the transfer of a dynamometer from an FRF of measured over applied force.

    Each column is divided by the static gain of its direct term: a hammer that is off by a few percent, or a force
    that is counted on the workpiece instead of the tool, does not change the shape of a transfer.

    Parameters
    ----------
    path
        FRF file, N/N, with responses and excitations among ``TCP:+X``, ``TCP:+Y`` and ``TCP:+Z``.

    Raises
    ------
    InputError
        No ratio of forces, no direction with a direct term, a static gain beyond a factor of 2, or a window that
        changed the damping.
    """
    frf = read_frf(path)
    name = Path(path).name
    if frf.quantity != "transfer" or frf.unit not in ("1", "N/N"):
        raise InputError(
            f"{name}: {frf.quantity} in {frf.unit} is no ratio of forces; tap on the dynamometer and estimate with "
            "millfrf tap TAPS... --excitation HAMMER --response FX --response FY --response FZ"
        )
    if frf.exponential_time_constant is not None:
        raise InputError(f"{name}: an exponential window changed the damping; estimate with --exponential none")
    return dynamometer_of(frf, name)


def dynamometer_of(frf: Frf, name: str) -> Dynamometer:
    """Return the transfer of an FRF of forces; see :func:`read_dynamometer`."""
    rows, columns = _axes(frf.responses, name), _axes(frf.excitations, name)
    valid = np.flatnonzero(frf.valid & (frf.frequencies > 0))
    if len(valid) < 2:
        raise InputError(f"{name}: fewer than 2 valid lines; tap harder, or more often")
    known = frf.entry_variance()
    values = np.tile(np.eye(3, dtype=complex), (len(valid) + 1, 1, 1))
    variance, tapped, warnings = np.zeros(values.shape), [], []
    for q, (axis, sign) in columns.items():
        direct = [p for p, (response, _) in rows.items() if response == axis]
        if not direct:
            continue
        lowest = valid[: max(3, round(STATIC_SHARE * len(valid)))]
        gain = sign * rows[direct[0]][1] * float(np.median(frf.values[lowest, direct[0], q].real))
        warnings += _gain_doubts(gain, TIP[axis], name)
        tapped.append(axis)
        for p, (response, of_response) in rows.items():
            values[1:, response, axis] = sign * of_response * frf.values[valid, p, q] / gain
            if known is not None:
                size = np.where(
                    np.isfinite(known[valid, p, q]), known[valid, p, q], np.abs(frf.values[valid, p, q]) ** 2
                )
                variance[1:, response, axis] = size / gain**2
    if not tapped:
        raise InputError(f"{name}: no force is measured along a tapped direction; name both TCP:+X, likewise Y and Z")
    missing = [TIP[axis] for axis in range(3) if axis not in tapped]
    if missing:
        warnings.append(f"{name} was not tapped along {', '.join(missing)}: taken as rigid there")
    return Dynamometer(np.concatenate([[0.0], frf.frequencies[valid]]), values, variance, tuple(warnings))


def _axes(labels: tuple[str, ...], name: str) -> dict[int, tuple[int, float]]:
    """Return axis and sign of each entry that lies at the tool."""
    node = DegreeOfFreedom.parse(TIP[0]).node
    entries = {}
    for entry, label in enumerate(labels):
        degree = DegreeOfFreedom.parse(label)
        if degree.node == node and degree.axis in ("X", "Y", "Z"):
            entries[entry] = ("XYZ".index(degree.axis), degree.sign)
    if len({axis for axis, _ in entries.values()}) < len(entries):
        raise InputError(f"{name}: a direction appears twice among {', '.join(labels)}; keep each once")
    return entries


def _gain_doubts(gain: float, label: str, name: str) -> list[str]:
    size = abs(gain)
    if not 1 / LARGEST_GAIN < size < LARGEST_GAIN:
        raise InputError(
            f"{name}: at its lowest lines the dynamometer shows {size:.3g} N for 1 N along {label}; check units, "
            "directions and charge amplifier, and tap again"
        )
    if abs(size - 1) > DOUBTED_GAIN:
        return [
            f"{name}: the dynamometer shows {size:.3g} N for 1 N of the hammer along {label}: one of them is "
            "miscalibrated; the dynamometer is taken as right"
        ]
    return []
