"""Tip receptance that a stability solver works on, from a modal model or a measured FRF."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import Complex, DegreeOfFreedom, InputError, Real
from modal_fit import ModalModel, Residuals

NOISY = 0.1
"""Noise of a line, over the largest receptance, from which lobes cannot use it: a limit is inverse to the receptance,
and would be off by as much."""

UNSEEN = 1 / 3
"""Noise of a line, over its own receptance, from which the line says nothing."""

MOSTLY = 0.7
"""Share of the lines from the lowest on that must be such noise: a coarse resonance looks rough at a few lines."""

ROUGHEST = 1.5
"""Roughness over its median in the band beyond which it is the structure's: a resonance between two lines is rough at
a few lines, noise of a sensor at all."""

WINDOW = 9
"""Lines over which noise and receptance are averaged."""

FEWEST = 8
"""Least number of lines that stay."""


def known_lines(frf: Frf) -> tuple[Frf, tuple[str, ...]]:
    """The receptance without the lines at which it is not known, and a sentence on what was left out.

    A receptance is the accelerance over ``-w^2``: noise of an accelerometer that is flat over the frequency becomes
    a huge flexibility at the lowest lines, and lobes take it for a structure that chatters below 1 Hz. The noise of
    a line is the standard error that the FRF states or, where that is larger, the roughness of the accelerance A,
    ``|A[k-1] - 2 A[k] + A[k+1]| / sqrt(6)``, which is the standard deviation of independent errors of equal size. A
    resonance that few lines resolve is rough as well, and must not be lost: roughness counts up to one and a half
    times its median in the band. Lines are left out up to the highest one below which most are such noise. Lines
    outside the band that the FRF states are left out, too.

    Parameters
    ----------
    frf
        Measured receptance at the tool tip, m/N, with its errors or coherence where they are known.

    Returns
    -------
    Frf
        The FRF with those lines marked as not valid, and with the band that is left; the same one where none is left
        out, or where fewer than eight would stay.
    tuple of str
        A sentence where noise was left out; empty where none was.

    Examples
    --------
    >>> f = np.linspace(0.125, 100, 800)
    >>> w, point = 2 * np.pi * f, ("T:+X",)
    >>> clean = 1e-6 / (1 - (f / 12) ** 2 + 0.08j * f / 12)
    >>> noise = 1e-4 * np.random.default_rng(1).normal(size=f.size)
    >>> frf = Frf(f, (clean - noise / w**2)[:, None, None], point, point, "receptance", "m/N", f > 0)
    >>> used, said = known_lines(frf)
    >>> bool(1 < used.band[0] < 6), float(used.band[1]), len(said)
    (True, 100.0, 1)
    """
    inside = _inside(frf)
    lines = frf.frequencies[inside]
    if len(lines) < FEWEST:
        return frf, ()
    # noise is alike from line to line where it was measured
    squares = (2 * np.pi * lines) ** 2
    accelerance = frf.values[inside] * squares[:, None, None]
    noise = _noise(frf, inside, accelerance, squares)
    first = _first_known(noise, np.linalg.norm(accelerance, axis=(1, 2)), squares)
    if len(lines) - first < FEWEST:
        return frf, ()
    valid = np.zeros_like(frf.valid)
    valid[np.flatnonzero(inside)[first:]] = True
    if np.array_equal(valid, frf.valid & (frf.frequencies > 0)):
        return frf, ()
    used = replace(frf, valid=valid, band=(float(lines[first]), float(lines[-1])))
    return used, (_sentence(lines, first),) if first else ()


def _sentence(lines: Real, first: int) -> str:
    return (
        f"between {lines[0]:.3g} and {lines[first - 1]:.3g} Hz the receptance is noise (an accelerance is divided by "
        "the square of the frequency): these lines are left out, and the structure is taken to be as stiff there as "
        f"at {lines[first]:.3g} Hz"
    )


def _inside(frf: Frf) -> NDArray[np.bool_]:
    """Valid lines above 0 Hz, inside the band that the FRF states."""
    low, high = frf.band or (0.0, np.inf)
    f = frf.frequencies
    return np.asarray(frf.valid & (f > 0) & (f >= low) & (f <= high))


def _noise(frf: Frf, inside: NDArray[np.bool_], values: NDArray[np.complex128], squares: Real) -> Real:
    """Noise of the accelerance at each line, Frobenius norm over the entries."""
    bent = np.linalg.norm(values[:-2] - 2 * values[1:-1] + values[2:], axis=(1, 2)) / np.sqrt(6)
    rough = np.minimum(_averaged(np.concatenate([bent[:1], bent, bent[-1:]])), ROUGHEST * np.median(bent))
    variance = frf.entry_variance()
    if variance is None:
        return np.asarray(rough)
    # an entry without coherence is noise as a whole, and no more than itself; NaN: not known
    size = np.abs(values) / squares[:, None, None]
    stated = np.sqrt(np.minimum(np.nan_to_num(variance[inside], nan=0.0, posinf=np.inf), size**2).sum(axis=(1, 2)))
    return np.asarray(np.maximum(rough, stated * squares))


def _first_known(noise: Real, size: Real, squares: Real) -> int:
    """Place of the lowest line that is known, from noise and size of the accelerance and ``w^2``."""
    size = _averaged(size)
    unseen = noise > UNSEEN * size
    largest = (size / squares)[~unseen].max(initial=0.0)
    bad = unseen & (noise / squares > NOISY * largest)
    mostly = np.cumsum(bad) >= MOSTLY * np.arange(1, len(bad) + 1)
    ends = np.flatnonzero(bad & mostly)
    return int(ends[-1]) + 1 if len(ends) else 0


def _averaged(values: Real) -> Real:
    """Root mean square over some lines around each; fewer at the ends."""
    weights = np.ones(min(WINDOW, len(values)))
    power = np.convolve(values**2, weights, "same") / np.convolve(np.ones(len(values)), weights, "same")
    return np.asarray(np.sqrt(power))


N_LINES = 400
AROUND = 0.2
"""Distance to which a model without a stated band holds beyond its lowest and highest mode, as a share of them."""


def with_residual_flexibility(model: ModalModel) -> ModalModel:
    """The model as lobes take it: one residual flexibility in place of the out-of-band terms of its fit.

    ``R[p, q] = mean over the band of Re(out-of-band terms)``. A fit puts poles of its own choice beyond the band, so
    that their values, slopes and curvatures match what modes there leave inside. Beyond the band they are resonances
    that nobody measured, and the harmonics of the tooth passing meet them: a true limit of 2 mm became none, or a
    twentieth. A constant carries the mean inside the band and no resonance outside (Ewins, Modal Testing, 2nd ed.,
    section 4.5). The modes stay as they are.

    Parameters
    ----------
    model
        Any modal model; one without terms at fixed poles comes back as it is.

    Examples
    --------
    >>> pole = np.array([-1 + 600j])
    >>> outside = Residuals(np.zeros((1, 1)), np.zeros((1, 1)), pole, np.array([[[-3e-4j]]]))
    >>> mode = ModalModel(
    ...     np.array([-2 + 100j]), np.array([[-1e-4j]]), np.ones((1, 1)) + 0j, ("T:+X",), ("T:+X",),
    ...     residuals=outside, band=(10.0, 22.0),
    ... )
    >>> told = with_residual_flexibility(mode).residuals
    >>> told.poles, told.upper.round(8).tolist()
    (None, [[1.03e-06]])
    """
    if model.residuals is None or model.residuals.poles is None:
        return model
    upper = model.residuals.receptance(_lines(model)).real.mean(axis=0)
    return replace(model, residuals=Residuals(upper, np.zeros_like(upper)))


def lost_inside(model: ModalModel) -> float:
    """How much of the FRF in the modes' half-power bands :func:`with_residual_flexibility` leaves out, as a share.

    Large where a mode stands just outside the band: then it shapes the FRF inside, and belongs into the fit.
    """
    if model.residuals is None or model.residuals.poles is None:
        return 0.0
    s = _lines(model)
    outside = model.residuals.receptance(s)
    left_out = np.linalg.norm(outside - outside.real.mean(axis=0), axis=(1, 2))
    size = np.linalg.norm(model.at(s), axis=(1, 2))
    axis, natural = s.imag / (2 * np.pi), model.natural_frequencies[:, None]
    resonant = (np.abs(axis - natural) <= model.damping_ratios[:, None] * natural).any(axis=0)
    if not resonant.any():
        return 0.0
    return float(np.sqrt(np.sum(left_out[resonant] ** 2) / np.sum(size[resonant] ** 2)))


def _lines(model: ModalModel) -> NDArray[np.complex128]:
    """Lines ``2 pi i f`` over the band, or about the modes where none is stated."""
    natural = model.natural_frequencies
    low, high = model.band or ((1 - AROUND) * natural.min(), (1 + AROUND) * natural.max())
    return np.asarray(2j * np.pi * np.linspace(low, high, N_LINES))


@dataclass(frozen=True)
class ToolReceptance:
    """Receptance between force and motion of the tool in X, Y, Z; directions that were not given are rigid.

    Parameters
    ----------
    evaluate
        Function that takes frequencies (n,) in Hz inside ``span`` and gives the receptance (n, 3, 3), m/N.
    grid : (n_lines,), Hz
        Frequencies so close that nothing between two of them is missed.
    span : Hz
        Lowest and highest frequency at which the receptance is known.
    warnings
        Doubts about the receptance, one sentence each.
    open_above
        Whether it may be evaluated above ``span`` too, as a modal model may.
    """

    evaluate: Callable[[Real], Complex]
    grid: Real
    span: tuple[float, float]
    warnings: tuple[str, ...] = ()
    open_above: bool = False


def tool_receptance(structure: Frf | ModalModel, *, node: str | None = None) -> ToolReceptance:
    """Take X, Y, Z of one node from a measured FRF or a modal model, signs and order put right.

    A measured FRF is interpolated linearly in real and imaginary part between its valid lines, those inside its band
    that are no noise (:func:`known_lines`); a modal model is
    evaluated where it is asked, from a twentieth of its lowest to three times its highest natural frequency.

    Parameters
    ----------
    structure
        FRF or modal model with responses and excitations at the tool.
    node
        Name of the tool's node; None: the excitations' only node.

    Raises
    ------
    InputError
        No common direction at the node, no receptance, or too few valid lines.
    """
    said: tuple[str, ...] = ()
    if isinstance(structure, Frf):
        structure, said = known_lines(to_receptance(structure))
    placed = tool_directions(structure, node).place
    if isinstance(structure, ModalModel):
        return _from_model(with_residual_flexibility(structure), placed)
    found = _from_frf(structure, placed)
    return replace(found, warnings=(*said, *found.warnings))


@dataclass(frozen=True)
class ToolDirections:
    """Rows and columns of a receptance that are X, Y, Z of the tool, with their signs."""

    rows: list[int]
    row_axes: list[int]
    row_signs: list[float]
    columns: list[int]
    column_axes: list[int]
    column_signs: list[float]

    def place(self, values: NDArray[Any]) -> NDArray[Any]:
        """Values (..., n_responses, n_excitations) as (..., 3, 3), zero in directions that were not given."""
        full = np.zeros((*values.shape[:-2], 3, 3), dtype=values.dtype)
        chosen = values[..., self.rows, :][..., self.columns] * np.outer(self.row_signs, self.column_signs)
        full[..., np.array(self.row_axes)[:, None], np.array(self.column_axes)[None, :]] = chosen
        return full

    def place_rows(self, vectors: Complex) -> Complex:
        """Right vectors (n_modes, n_responses) as (n_modes, 3)."""
        full = np.zeros((len(vectors), 3), dtype=complex)
        full[:, self.row_axes] = vectors[:, self.rows] * np.array(self.row_signs)
        return full

    def place_columns(self, vectors: Complex) -> Complex:
        """Left vectors (n_modes, n_excitations) as (n_modes, 3)."""
        full = np.zeros((len(vectors), 3), dtype=complex)
        full[:, self.column_axes] = vectors[:, self.columns] * np.array(self.column_signs)
        return full


def tool_directions(structure: Frf | ModalModel, node: str | None = None) -> ToolDirections:
    """Find X, Y, Z of the tool among the degrees of freedom of a receptance.

    Raises
    ------
    InputError
        No receptance, excitations at several nodes, or no response or excitation at the tool.
    """
    if structure.quantity != "receptance" or structure.unit != "m/N":
        raise InputError(
            f"stability needs a receptance in m/N, this is {structure.quantity} in {structure.unit}; give a model or "
            "an FRF of receptance"
        )
    node = node or _only_node(structure.excitations)
    rows, row_axes, row_signs = _directions(structure.responses, node)
    columns, column_axes, column_signs = _directions(structure.excitations, node)
    if not rows or not columns:
        raise InputError(
            f"no response at the tool: excited at {node}, responses at {', '.join(structure.responses)}; "
            "calibrate the model to the tip first, or, if the sensor sat at the tip, name its node TCP in the mapping"
        )
    return ToolDirections(rows, row_axes, row_signs, columns, column_axes, column_signs)


def _only_node(labels: tuple[str, ...]) -> str:
    nodes = sorted({DegreeOfFreedom.parse(label).node for label in labels})
    if len(nodes) != 1:
        found = ", ".join(nodes) or "none"
        raise InputError(f"excitations at one node are needed, got {found}; name the tool's node or give an FRF of it")
    return nodes[0]


def _directions(labels: tuple[str, ...], node: str) -> tuple[list[int], list[int], list[float]]:
    places, axes, signs = [], [], []
    for place, label in enumerate(labels):
        dof = DegreeOfFreedom.parse(label)
        if dof.node == node and dof.axis in ("X", "Y", "Z"):
            axis = "XYZ".index(dof.axis)
            if axis in axes:
                raise InputError(f"direction {dof.axis} of {node} appears twice; give each direction once")
            places.append(place)
            axes.append(axis)
            signs.append(dof.sign)
    return places, axes, signs


def _from_model(model: ModalModel, placed: Callable[[Complex], Complex]) -> ToolReceptance:
    if not len(model.poles):
        raise InputError("the modal model has no mode; fit at least one")
    if model.poles.real.max() >= 0:
        worst = model.poles[model.poles.real.argmax()]
        raise InputError(f"the structure itself is unstable: pole {worst:.4g} rad/s does not decay; fit again")
    natural = model.natural_frequencies
    low, high = 0.05 * float(natural.min()), 3.0 * float(natural.max())
    steps = [np.geomspace(low, high, 400)]
    for pole in model.poles:
        width = -pole.real / (2 * np.pi)
        steps.append(pole.imag / (2 * np.pi) + width * np.sinh(np.linspace(-4, 4, 161)))
    grid = np.unique(np.concatenate(steps))
    grid = grid[(grid >= low) & (grid <= high)]

    def evaluate(frequencies: Real) -> Complex:
        return placed(model.receptance(frequencies))

    return ToolReceptance(evaluate, grid, (low, high), open_above=True)


def reaching(source: ToolReceptance, force: Real, max_depth: float) -> ToolReceptance:
    """Follow a modal model's receptance up to where no depth that is asked for can close the loop.

    That is where ``2 a |force| |H|`` stays below 1: at high spindle speed a damped structure chatters far above its
    natural frequencies, since cutting stiffens it. A measured FRF ends where it ends.

    Parameters
    ----------
    source
        Receptance at the tool; a measured one is returned as it is.
    force : (3, 3), Pa
        Cutting force per depth and motion.
    max_depth : m
        Largest axial depth that is asked for.
    """
    if not source.open_above:
        return source
    gain = 2 * max_depth * float(np.linalg.norm(force, 2))
    above = np.geomspace(source.span[1], 1e3 * source.span[1], 700)[1:]
    closing = gain * np.linalg.norm(source.evaluate(above), 2, axis=(1, 2)) > 1
    if not closing.any():
        return source
    above = above[: int(np.flatnonzero(closing)[-1]) + 2]
    return replace(source, grid=np.append(source.grid, above), span=(source.span[0], float(above[-1])))


def _from_frf(frf: Frf, placed: Callable[[Complex], Complex]) -> ToolReceptance:
    valid = frf.valid & (frf.frequencies > 0)
    if valid.sum() < 8:
        raise InputError(f"the FRF has {valid.sum()} valid lines above 0 Hz; too few to draw lobes from")
    lines, values = frf.frequencies[valid], frf.values[valid]

    def evaluate(frequencies: Real) -> Complex:
        upper = np.clip(np.searchsorted(lines, frequencies), 1, len(lines) - 1)
        share = (frequencies - lines[upper - 1]) / (lines[upper] - lines[upper - 1])
        between = values[upper - 1] + share[:, None, None] * (values[upper] - values[upper - 1])
        return placed(np.asarray(between))

    gaps = np.diff(lines) > 1.5 * np.median(np.diff(lines))
    warnings = (f"{gaps.sum()} gaps in the valid lines are bridged by straight lines",) if gaps.any() else ()
    return ToolReceptance(evaluate, lines, (float(lines[0]), float(lines[-1])), warnings)
