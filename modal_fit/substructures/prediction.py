"""Receptance at the tip of another tool on an identified base, with its errors."""

from dataclasses import dataclass

import numpy as np

from estimation import Frf, FrfCovariance
from millfrf.core import Band, Complex, InputError, Real

from ..settings import SETTINGS
from .assembly import free_tool
from .base import Base, free_blank
from .base_lines import by_base
from .tool_file import Tool, check_together

TIP_NODE = "TCP"


@dataclass(frozen=True)
class PredictedTip:
    """Receptance at the tip of a tool that was not measured.

    Parameters
    ----------
    frf
        Receptance in the directions of the taps, with the covariance from their noise and with errors common to all
        lines, in the band that the taps cover.
    deviation : (n_lines, n_directions), m/N
        Standard error of the receptance in each direction, with changes by whole standard errors of the causes: where
        these move a resonance by more than its width, those of the FRF, which are of first order, are too large.
    shares
        Root mean square over the lines of the standard error from each source, over that of the receptance.
    """

    frf: Frf
    deviation: Real
    shares: dict[str, float]


def predict_tip(base: Base, tool: Tool, frequencies: Real, time_constant: float | None) -> PredictedTip:
    """Couple a tool to a base.

    Noise of the taps gives an error that is independent from line to line. The contact and what the descriptions of
    blanks and tool leave open give errors that all lines share, for which the base is identified anew.

    Parameters
    ----------
    base
        Receptance of the base on its lines, with contact and corrections of the blanks' files.
    tool
        Tool on it; its quantities of the blanks' names, such as Young's modulus, have the blanks' errors.
    frequencies : (n_lines,), Hz
        Frequencies of the lines of the base.
    time_constant : s, or None
        Time constant of the taps' exponential window, which the result keeps.

    Raises
    ------
    InputError
        A tool with the name of a blank, with a material that is another there, or with a contact that no blank had; a
        prediction whose error exceeds the receptance.
    """
    check_together([*(blank.tool for blank in base.taps.blanks), tool])
    if tool.first_of_tool and not base.has_contact:
        raise InputError(
            f"{tool.name} has a contact, but no blank has: leave out contact = true where tool and blanks are clamped "
            "alike, or give the blanks the contact"
        )
    tool = Tool(tool.name, tool.table.model_copy(update={"distance_from_tip_m": {TIP_NODE: 0.0}}))
    own = [name for name in tool.uncertain() if name not in base.names]
    names, n = (*base.names, *own), len(base.numbers)
    values, variance = _tip(base, tool, names, np.concatenate([base.numbers, np.zeros(len(own))]))
    root = np.zeros((len(names), len(names)))
    if n:
        eigenvalues, vectors = np.linalg.eigh(base.covariance * base.scale)
        root[:n, :n] = vectors * np.sqrt(np.maximum(eigenvalues, 0.0))
    root[n:, n:] = np.eye(len(own))
    centre = np.concatenate([base.numbers, np.zeros(len(own))])

    def changes(part: float) -> Complex:
        ends = [[_tip(base, tool, names, centre + sign * part * column)[0] for sign in (1, -1)] for column in root.T]
        return np.array([(above - below) / (2 * part) for above, below in ends]).reshape(len(names), *values.shape)

    whole = changes(1.0)
    squares = np.concatenate([variance[None], np.abs(whole) ** 2])
    measured, noise = _of_taps(base)
    lines = trusted_lines(
        np.column_stack([np.abs(values) ** 2, measured]), np.column_stack([squares.sum(axis=0), noise])
    )
    frf = _as_frf(list(base.lines), frequencies, values, variance, changes(SETTINGS.number_step), time_constant, lines)
    return PredictedTip(frf, np.sqrt(squares.sum(axis=0)), _shares(values, squares, slice(*lines), n, own))


def _of_taps(base: Base) -> tuple[Real, Real]:
    """Return power and noise of the measured receptances, (n_lines,) each: geometric means over the entries.

    Where the taps themselves are noise, first-order errors of the base are far too small.
    """
    entries = [entry for each in base.taps.entries.values() for entry in each]
    power = np.log([np.maximum(np.abs(entry.values) ** 2, 1e-300) for entry in entries])
    noise = np.log([np.maximum(entry.variance, 1e-300) for entry in entries])
    return np.exp(power.mean(axis=0)), np.exp(noise.mean(axis=0))


def _tip(base: Base, tool: Tool, names: tuple[str, ...], numbers: Real) -> tuple[Complex, Real]:
    """Return the receptance at the tip, (n_lines, n_directions), and its variance from the taps' noise."""
    n = len(base.numbers)
    lines = base.lines if np.array_equal(numbers[:n], base.numbers) else base.moved(numbers[:n])
    free = free_blank(tool, (TIP_NODE,), base.taps.s, names, numbers, base.compliance_unit)
    values, variances = [], []
    for each in lines.values():
        values.append(free.on_base(each.matrix)[:, 0, 0])
        force = free.forces(each.matrix)[:, :, 0]
        slopes = by_base(force, force)
        variance = np.einsum("nj,njk,nk->n", slopes, each.covariance, slopes.conj()).real * base.scale
        variances.append(np.maximum(variance, 0.0))  # rounding may turn the variance of exact taps negative
    return np.stack(values, axis=1), np.stack(variances, axis=1)


def _as_frf(
    directions: list[str],
    frequencies: Real,
    values: Complex,
    variance: Real,
    common: Complex,
    time_constant: float | None,
    lines: tuple[int, int],
) -> Frf:
    """Place directions on the diagonal of an FRF matrix, and mark the lines that can be trusted."""
    size = len(directions)
    places = tuple(f"{TIP_NODE}:+{direction}" for direction in directions)
    diagonal = np.eye(size)
    valid = np.zeros(len(frequencies), dtype=bool)
    valid[slice(*lines)] = True
    band: Band = (float(frequencies[lines[0]]), float(frequencies[lines[1] - 1]))
    return Frf(
        frequencies,
        values[:, :, None] * diagonal,
        places,
        places,
        "receptance",
        "m/N",
        valid,
        covariance=FrfCovariance(
            (variance[:, :, None] * diagonal).astype(complex), np.tile(diagonal.astype(complex), (len(values), 1, 1))
        ),
        band=band,
        exponential_time_constant=time_constant,
        measured=None if size == 1 else diagonal.astype(bool),
        common_errors=common[:, :, :, None] * diagonal,
    )


def trusted_lines(power: Real, error: Real) -> tuple[int, int]:
    """Return first and last line (plus 1) of the range at whose ends the error does not exceed the receptance.

    From either end lines are left out up to where the sum of ``ln(2 error / power)`` is largest, if it is positive: an
    antiresonance inside the range, where the receptance is small, leaves nothing out.

    Parameters
    ----------
    power, error : (n_lines, n_receptances)
        Squared receptances and their variances.

    Raises
    ------
    InputError
        No range remains.

    Examples
    --------
    >>> trusted_lines(np.array([[1.0], [1.0], *[[9.0]] * 5, [0.5], *[[9.0]] * 5]), np.ones((13, 1)))
    (2, 13)
    """
    # a predicted power contains its error, so that the receptance without it has the rest: power less error
    excess = np.log(2 * np.maximum(error, 1e-300) / np.maximum(power, 1e-300)).max(axis=1)
    from_below = np.concatenate([[0.0], np.cumsum(excess)])
    from_above = np.concatenate([[0.0], np.cumsum(excess[::-1])])
    low, high = int(np.argmax(from_below)), len(excess) - int(np.argmax(from_above))
    if high - low < SETTINGS.fewest_lines or excess[low:high].sum() > 0:
        raise InputError(
            "the error of the predicted receptance exceeds it: the taps are too noisy for this tool, or their points "
            "are too near to each other; tap more often, further apart, on a blank that is more like the tool"
        )
    return low, high


def _shares(values: Complex, squares: Real, lines: slice, n_of_base: int, own: list[str]) -> dict[str, float]:
    """Return the root mean square error of each source over that of the receptance."""
    power = squares[:, lines].sum(axis=(1, 2)) / np.sum(np.abs(values[lines]) ** 2)
    sources = {"noise of the taps": power[0], "blanks and contact": power[1 : 1 + n_of_base].sum()}
    sources |= dict(zip(own, power[1 + n_of_base :], strict=True))
    return {name: float(np.sqrt(square)) for name, square in sources.items()}


def first_clamped_frequency(tool: Tool, highest: float) -> float:
    """Return the first natural frequency (Hz) of a tool that is clamped rigidly, at most ``highest``, else infinity.

    A base that gives way lowers it. It is that at which the receptance at the tip of the loss-free tool changes sign
    through infinity.
    """
    table = tool.table.model_copy(
        update={
            "distance_from_tip_m": {TIP_NODE: 0.0},
            "material": {
                name: material.model_copy(update={"loss_factor": 0.0}) for name, material in tool.table.material.items()
            },
        }
    )
    frequencies = np.geomspace(highest / 1e3, highest, SETTINGS.clamped_lines)
    rigid = np.zeros((len(frequencies), 2, 2), dtype=complex)
    free = free_tool(
        Tool(tool.name, table), (TIP_NODE,), np.asarray(2j * np.pi * frequencies), np.zeros(2, dtype=complex)
    )
    inverse = 1 / free.on_base(rigid)[:, 0, 0].real
    poles = np.flatnonzero((inverse[1:] < 0) & (inverse[:-1] >= 0))
    return float(frequencies[poles[0]]) if len(poles) else np.inf
