"""Tip receptance that a stability solver works on, from a modal model or a measured FRF."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, shared_points, to_receptance
from millfrf.core import Band, Complex, DegreeOfFreedom, InputError, Real
from modal_fit import ModalModel, Residuals, outside_as_residuals

from .settings import SETTINGS


def known_lines(frf: Frf) -> tuple[Frf, tuple[str, ...]]:
    """Return the receptance without the lines at which it is not known, and a warning about the lines left out.

    A receptance is the accelerance over ``-w^2``. Accelerometer noise that is flat over frequency becomes a huge
    flexibility at the lowest lines, and lobes would take it for a structure that chatters below 1 Hz. The noise of
    a line is the standard error that the FRF states or, where that is larger, the roughness of the accelerance A,
    ``|A[k-1] - 2 A[k] + A[k+1]| / sqrt(6)``, which is the standard deviation of independent errors of equal size. A
    resonance that few lines resolve is rough as well and must be kept: roughness is limited to one and a half times
    its median in the band. Lines are left out up to the highest one below which most lines are noise.

    The error of an integrated acceleration (leakage, drift) is smooth and shows no noise, but a passive structure
    returns no power, ``Im H_pp <= 0``: where the mean over nine lines is above 0, it is a lower bound of the error,
    which grows towards 0 Hz. Lines below a stretch with such an error above a third of the line are left out if no
    resonance lies among them: the mobility is then largest at their lower end. Lines outside the band that the FRF
    states are left out, too.

    Parameters
    ----------
    frf
        Measured receptance at the tool tip, m/N, with its errors or coherence where they are known.

    Returns
    -------
    Frf
        The FRF with those lines marked as not valid, and with the remaining band. It is unchanged where no line is
        left out, or where fewer than eight lines would remain.
    tuple of str
        One warning where lines were left out as noise; otherwise empty.

    Examples
    --------
    >>> f = np.linspace(0.125, 100, 800)
    >>> w, point = 2 * np.pi * f, ("T:+X",)
    >>> clean = 1e-6 / (1 - (f / 12) ** 2 + 0.08j * f / 12)
    >>> noise = 1e-4 * np.random.default_rng(1).normal(size=f.size)
    >>> frf = Frf(f, (clean - noise / w**2)[:, None, None], point, point, "receptance", "m/N", f > 0)
    >>> used, warnings = known_lines(frf)
    >>> bool(1 < used.band[0] < 6), float(used.band[1]), len(warnings)
    (True, 100.0, 1)
    """
    low, high = frf.band or (0.0, np.inf)
    in_band = frf.valid & (frf.frequencies > 0) & (frf.frequencies >= low) & (frf.frequencies <= high)
    lines = frf.frequencies[in_band]
    if len(lines) < SETTINGS.least_lines:
        return frf, ()
    # noise is compared as accelerance, in which it was measured: there its size is alike from line to line
    squares = (2 * np.pi * lines) ** 2
    accelerance = frf.values[in_band] * squares[:, None, None]
    noise, size = _noise(frf, in_band, accelerance, squares), np.linalg.norm(accelerance, axis=(1, 2))
    first = _first_known(noise, size, squares)
    first = max(first, _first_passive(frf, accelerance, noise, size / np.sqrt(squares), first))
    if len(lines) - first < SETTINGS.least_lines:
        return frf, ()
    valid = np.zeros_like(frf.valid)
    valid[np.flatnonzero(in_band)[first:]] = True
    if np.array_equal(valid, frf.valid & (frf.frequencies > 0)):
        return frf, ()
    used = replace(frf, valid=valid, band=(float(lines[first]), float(lines[-1])))
    if not first:
        return used, ()
    warning = (
        f"between {lines[0]:.3g} and {lines[first - 1]:.3g} Hz the receptance is noise, or an error of the integration "
        "(an accelerance is divided by the square of the frequency): these lines are left out, and the structure is "
        f"taken to be as stiff there as at {lines[first]:.3g} Hz"
    )
    return used, (warning,)


def _noise(frf: Frf, in_band: NDArray[np.bool_], accelerance: Complex, squares: Real) -> Real:
    """Estimate the noise of the accelerance at each line, as Frobenius norm over all entries."""
    bend = np.linalg.norm(accelerance[:-2] - 2 * accelerance[1:-1] + accelerance[2:], axis=(1, 2)) / np.sqrt(6)
    # a resonance between two lines is rough at a few lines, sensor noise at all of them: hence the median
    roughness = _averaged(np.concatenate([bend[:1], bend, bend[-1:]]))
    roughness = np.minimum(roughness, SETTINGS.largest_roughness * np.median(bend))
    variance = frf.entry_variance()
    if variance is None:
        return np.asarray(roughness)
    # an entry without coherence is noise as a whole, and no more than itself; NaN: not known
    size = np.abs(accelerance) / squares[:, None, None]
    stated = np.sqrt(np.minimum(np.nan_to_num(variance[in_band], nan=0.0, posinf=np.inf), size**2).sum(axis=(1, 2)))
    return np.asarray(np.maximum(roughness, stated * squares))


def _first_known(noise: Real, size: Real, squares: Real) -> int:
    """Find the index of the lowest known line, from noise and size of the accelerance and ``w^2``."""
    size = _averaged(size)
    hidden = noise > SETTINGS.noise_over_line * size
    largest = (size / squares)[~hidden].max(initial=0.0)
    unusable = hidden & (noise / squares > SETTINGS.noise_over_largest * largest)
    # most lines below must be unusable, too: a coarse resonance looks rough at a few lines
    mostly = np.cumsum(unusable) >= SETTINGS.unusable_share * np.arange(1, len(unusable) + 1)
    ends = np.flatnonzero(unusable & mostly)
    return int(ends[-1]) + 1 if len(ends) else 0


def _first_passive(frf: Frf, accelerance: Complex, noise: Real, mobility: Real, first: int) -> int:
    """Find the index of the first line above those at which a drive point returns power and no resonance shows.

    ``noise`` of the accelerance on each line, and ``mobility``, the size of the FRF matrix over the lines, up to a
    factor. A mean over nine lines that is above the noise of one line is no chance: it has a third of that noise.
    """
    weights = np.ones(min(9, len(mobility)))
    returns = np.zeros(len(mobility), dtype=bool)
    for point in shared_points(frf.responses, frf.excitations):
        own = accelerance[:, point.row, point.column] * (point.response_sign * point.excitation_sign)
        mean = np.convolve(own.imag, weights, "same") / np.convolve(np.ones(len(own)), weights, "same")
        returns |= mean > np.maximum(noise, SETTINGS.noise_over_line * _averaged(np.abs(own)))
    for last in np.flatnonzero(returns)[::-1]:
        if last > first and mobility[first : last + 1].argmax() == 0:
            return int(last) + 1
    return first


def _averaged(values: Real) -> Real:
    """Compute the root mean square over the nine lines around each line; over fewer lines at the ends."""
    weights = np.ones(min(9, len(values)))
    power = np.convolve(values**2, weights, "same") / np.convolve(np.ones(len(values)), weights, "same")
    return np.asarray(np.sqrt(power))


def with_residual_flexibility(model: ModalModel) -> ModalModel:
    """Return the model for lobes: one residual flexibility in place of the out-of-band terms of its fit.

    ``R[p, q] = mean over the band of Re(out-of-band terms)``. Lines below the lowest mode at which the terms exceed the
    modes are left out: there the terms describe the error of an integrated acceleration, which grows with ``1/f^2``,
    and made a flexibility six times that of the modes in a band from 2 Hz.

    A fit puts extraneous poles beyond the band to describe the effect of real modes beyond the band on the FRF inside
    it. Outside the band these poles are resonances that were not measured. Harmonics of the tooth passing can meet
    them: a true limit of 2 mm vanished, or became 0.1 mm. A constant keeps the mean inside the band and has no
    resonance outside (Ewins, Modal Testing, 2nd ed., section 4.5).
    The modes are unchanged.

    Parameters
    ----------
    model
        Any modal model; one without out-of-band poles is returned unchanged.

    Examples
    --------
    >>> pole = np.array([-1 + 600j])
    >>> outside = Residuals(np.zeros((1, 1)), np.zeros((1, 1)), pole, np.array([[[-3e-4j]]]))
    >>> mode = ModalModel(
    ...     np.array([-2 + 100j]), np.array([[-1e-4j]]), np.ones((1, 1)) + 0j, ("T:+X",), ("T:+X",),
    ...     residuals=outside, band=(10.0, 22.0),
    ... )
    >>> residuals = with_residual_flexibility(mode).residuals
    >>> residuals.poles, residuals.upper.round(8).tolist()
    (None, [[1.03e-06]])
    """
    if model.residuals is None or model.residuals.poles is None:
        return model
    upper = model.residuals.receptance(_residual_lines(model, model.residuals)).real.mean(axis=0)
    return replace(model, residuals=Residuals(upper, np.zeros_like(upper)))


def restricted_to(structure: Frf | ModalModel, band: Band) -> Frf | ModalModel:
    """Return an FRF with the lines of a band (Hz) only, or a modal model that holds in the band only.

    Modes of a model outside the band become out-of-band terms, which lobes replace by one residual flexibility
    (:func:`with_residual_flexibility`).

    Raises
    ------
    InputError
        A band without enough valid lines, or without a mode.
    """
    low, high = band
    if not 0 < low < high:
        raise InputError(f"band {low:g} to {high:g} Hz is empty or starts at 0; give 0 < low < high")
    own = structure.band or (low, high)
    shared = (max(low, own[0]), min(high, own[1]))
    if isinstance(structure, Frf):
        f = structure.frequencies
        valid = structure.valid & (f >= low) & (f <= high)
        if valid.sum() < SETTINGS.least_lines or shared[0] >= shared[1]:
            raise InputError(
                f"{valid.sum()} valid lines lie between {low:g} and {high:g} Hz (the FRF has {f[0]:g} to "
                f"{f[-1]:g} Hz); widen the band (--band)"
            )
        return replace(structure, valid=valid, band=shared)
    natural = structure.natural_frequencies
    inside = (natural >= low) & (natural <= high)
    if not inside.any() or shared[0] >= shared[1]:
        raise InputError(
            f"no mode lies between {low:g} and {high:g} Hz (the model has {natural.min():.4g} to "
            f"{natural.max():.4g} Hz); widen the band (--band)"
        )
    return replace(outside_as_residuals(structure, inside), band=shared)


def lost_share(model: ModalModel) -> float:
    """Compute the share of the FRF, in the modes' half-power bands, that :func:`with_residual_flexibility` loses.

    It is large if a mode lies just outside the band: such a mode shapes the FRF inside the band and should be fitted.
    """
    if model.residuals is None or model.residuals.poles is None:
        return 0.0
    s = _residual_lines(model, model.residuals)
    outside = model.residuals.receptance(s)
    left_out = np.linalg.norm(outside - outside.real.mean(axis=0), axis=(1, 2))
    size = np.linalg.norm(model.at(s), axis=(1, 2))
    axis, natural = s.imag / (2 * np.pi), model.natural_frequencies[:, None]
    resonant = (np.abs(axis - natural) <= model.damping_ratios[:, None] * natural).any(axis=0)
    if not resonant.any():
        return 0.0
    return float(np.sqrt(np.sum(left_out[resonant] ** 2) / np.sum(size[resonant] ** 2)))


def _residual_lines(model: ModalModel, residuals: Residuals) -> Complex:
    """Return points ``2 pi i f`` over the band, without those below the modes at which the residuals are larger."""
    s = _band_lines(model)
    outside = residuals.receptance(s)
    size, modes = (np.linalg.norm(part, axis=(1, 2)) for part in (outside, model.at(s) - outside))
    low = s.imag < 2 * np.pi * model.natural_frequencies.min(initial=np.inf)
    known = ~low | (size <= modes)
    return s[known] if known.any() else s


def _band_lines(model: ModalModel) -> Complex:
    """Return 400 points ``2 pi i f`` over the band; without a stated band, from 20 % below to 20 % above the modes."""
    natural = model.natural_frequencies
    low, high = model.band or ((1 - 0.2) * natural.min(), (1 + 0.2) * natural.max())
    return np.asarray(2j * np.pi * np.linspace(low, high, 400))


@dataclass(frozen=True)
class ToolReceptance:
    """Receptance between force and motion of the tool in X, Y, Z; directions that were not measured are rigid."""

    evaluate: Callable[[Real], Complex]  # frequencies (n,), Hz, inside the span to receptance (n, 3, 3), m/N
    grid: Real  # (n_lines,), Hz: so close that the receptance changes little between two of them
    span: tuple[float, float]  # Hz: lowest and highest frequency at which the receptance is known
    warnings: tuple[str, ...] = ()
    open_above: bool = False  # whether it may be evaluated above the span, too, as a modal model may


def tool_receptance(structure: Frf | ModalModel | ToolReceptance) -> ToolReceptance:
    """Extract the receptance of the excited node in X, Y, Z, with signs and order corrected; return one unchanged.

    A measured FRF is interpolated linearly in real and imaginary part between its known lines (:func:`known_lines`). A
    modal model is evaluated at any frequency, from a twentieth of its lowest to three times its highest natural
    frequency.
    """
    if isinstance(structure, ToolReceptance):
        return structure
    warnings: tuple[str, ...] = ()
    if isinstance(structure, Frf):
        structure, warnings = known_lines(to_receptance(structure))
    placed = tool_directions(structure).place
    if isinstance(structure, ModalModel):
        return _from_model(with_residual_flexibility(structure), placed)
    receptance = _from_frf(structure, placed)
    return replace(receptance, warnings=(*warnings, *receptance.warnings))


@dataclass(frozen=True)
class Directions:
    """Indices of the degrees of freedom that are X, Y, Z of the tool, and their signs."""

    entries: list[int]
    axes: list[int]  # 0: X, 1: Y, 2: Z
    signs: list[float]

    def place(self, vectors: NDArray[Any]) -> NDArray[Any]:
        """Rearrange vectors (..., n_degrees) to X, Y, Z, (..., 3); zero in directions that were not measured."""
        full = np.zeros((*vectors.shape[:-1], 3), dtype=vectors.dtype)
        full[..., self.axes] = vectors[..., self.entries] * np.array(self.signs)
        return full


@dataclass(frozen=True)
class ToolDirections:
    """Directions of the tool among responses and among excitations."""

    responses: Directions
    excitations: Directions

    def place(self, values: NDArray[Any]) -> NDArray[Any]:
        """Rearrange values (..., n_responses, n_excitations) to X, Y, Z, (..., 3, 3); zero if not measured."""
        return self.excitations.place(self.responses.place(values.swapaxes(-1, -2)).swapaxes(-1, -2))


def tool_directions(structure: Frf | ModalModel) -> ToolDirections:
    """Find X, Y, Z of the tool, the only excited node, among the degrees of freedom of a receptance."""
    if structure.quantity != "receptance" or structure.unit != "m/N":
        raise InputError(
            f"stability needs a receptance in m/N, this is {structure.quantity} in {structure.unit}; give a model or "
            "an FRF of receptance"
        )
    nodes = sorted({DegreeOfFreedom.parse(label).node for label in structure.excitations})
    if len(nodes) != 1:
        raise InputError(
            f"excitations at one node are needed, got {', '.join(nodes) or 'none'}; give a model or an FRF that is "
            "excited at the tool alone"
        )
    responses, excitations = (_directions(labels, nodes[0]) for labels in (structure.responses, structure.excitations))
    if not responses.axes or not excitations.axes:
        raise InputError(
            f"no response at the tool: excited at {nodes[0]}, responses at {', '.join(structure.responses)}; "
            "calibrate the model to the tip first, or, if the sensor sat at the tip, name its node TCP in the mapping"
        )
    return ToolDirections(responses, excitations)


def _directions(labels: tuple[str, ...], node: str) -> Directions:
    result = Directions([], [], [])
    for entry, label in enumerate(labels):
        degree = DegreeOfFreedom.parse(label)
        if degree.node == node and degree.axis in ("X", "Y", "Z"):
            axis = "XYZ".index(degree.axis)
            if axis in result.axes:
                raise InputError(f"direction {degree.axis} of {node} appears twice; give each direction once")
            result.entries.append(entry)
            result.axes.append(axis)
            result.signs.append(degree.sign)
    return result


def check_modes(model: ModalModel) -> None:
    """Refuse a model without modes or with a mode that does not decay."""
    if not len(model.poles):
        raise InputError("the modal model has no mode; fit at least one")
    if model.poles.real.max() >= 0:
        worst = model.poles[model.poles.real.argmax()]
        raise InputError(f"the structure itself is unstable: pole {worst:.4g} rad/s does not decay; fit again")


def _from_model(model: ModalModel, placed: Callable[[Complex], Complex]) -> ToolReceptance:
    check_modes(model)
    natural = model.natural_frequencies
    low, high = 0.05 * float(natural.min()), 3.0 * float(natural.max())
    # lines are as dense as the peak of each mode is narrow
    lines = [np.geomspace(low, high, 400)]
    for pole in model.poles:
        width = -pole.real / (2 * np.pi)
        lines.append(pole.imag / (2 * np.pi) + width * np.sinh(np.linspace(-4, 4, 161)))
    grid = np.unique(np.concatenate(lines))
    grid = grid[(grid >= low) & (grid <= high)]
    return ToolReceptance(lambda frequencies: placed(model.receptance(frequencies)), grid, (low, high), open_above=True)


def reaching(source: ToolReceptance, force: Real, max_depth: float) -> ToolReceptance:
    """Extend a modal model's receptance to frequencies above which no depth up to ``max_depth`` (m) is unstable.

    Above them ``2 a |force| |H|`` stays below 1; ``force`` (3, 3), Pa, is the cutting force per depth and motion. At
    high spindle speed a damped structure chatters far above its natural frequencies, because cutting stiffens it. A
    measured FRF is returned unchanged.
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
    if valid.sum() < SETTINGS.least_lines:
        raise InputError(f"the FRF has {valid.sum()} valid lines above 0 Hz; too few to draw lobes from")
    lines, values = frf.frequencies[valid], frf.values[valid]

    def evaluate(frequencies: Real) -> Complex:
        upper = np.clip(np.searchsorted(lines, frequencies), 1, len(lines) - 1)
        share = (frequencies - lines[upper - 1]) / (lines[upper] - lines[upper - 1])
        between = values[upper - 1] + share[:, None, None] * (values[upper] - values[upper - 1])
        return placed(np.asarray(between))

    gaps = np.diff(lines) > 1.5 * np.median(np.diff(lines))
    warnings = (f"{gaps.sum()} gaps in the valid lines are interpolated linearly",) if gaps.any() else ()
    return ToolReceptance(evaluate, lines, (float(lines[0]), float(lines[-1])), warnings)
