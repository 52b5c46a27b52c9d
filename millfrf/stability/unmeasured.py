"""Bound of the dynamics outside the measured band, from what a model or an FRF shows inside it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import Band, Complex, Real
from modal_fit import ModalModel, derived_covariance

from .settings import SETTINGS
from .tip_receptance import known_lines, tool_directions, with_residual_flexibility

N_LINES = 200  # at which out-of-band terms are compared with the two textbook residuals


@dataclass(frozen=True)
class UnmeasuredDynamics:
    """Modes that no measurement shows: reciprocal, outside the band, damped by at least ``damping``.

    Parameters
    ----------
    band : (2,), Hz
        Lowest and highest frequency that was measured.
    flexibility : m/N
        Upper bound of the static flexibility of all modes above the band together (largest singular value).
    inertance : 1/kg
        Upper bound of the modes below the band together, whose receptance is ``-inertance / w^2`` inside it.
    lines : (n_lines,), Hz
        Lines inside the band.
    in_band : (n_lines,), m/N
        Difference at ``lines`` between the fitted out-of-band terms and the constant that lobes use for them.
    damping
        Least damping ratio of an unmeasured mode.
    cross_terms
        Bound (m/N) of cross terms between measured directions that were not measured, at frequencies (n,), Hz
        (:func:`unmeasured_dynamics`); None: all were measured.
    lowest_mode : Hz
        Frequency below which no mode lies, as the model states.
    """

    band: Band
    flexibility: float
    inertance: float
    lines: Real
    in_band: Real
    damping: float
    cross_terms: Callable[[Real], Real] | None = None
    lowest_mode: float = 0.0

    def discs(self, frequencies: Real) -> tuple[Complex, Real]:
        """Return centre and radius (m/N) of the unmeasured receptance at frequencies of either sign, Hz.

        A mode of the damping ratio z or more adds ``g = 1 / (1 - r^2 + 2 i z r)`` times its flexibility at the ratio r
        of the frequencies. All g, and 0, lie in the disc with the centre ``-i / (4 z)`` and the radius
        ``(1 + z + 2 z^2) / (4 z)``. A sum of modes with positive semidefinite residues and a total flexibility u lies
        in u times this disc: it is centre plus radius times a matrix of norm 1 at most.

        Below the band the modes above it count as static, 0 to u, and modes below it have the same disc with
        ``inertance / w^2`` for u. The radius is limited there by the largest flexibility of a machine at resonance.
        Below the lowest mode no mode is more flexible than at its frequency.
        Inside the band the data show everything but the error of the fit, and cross terms that were not measured.
        """
        size = np.maximum(np.abs(frequencies), 1e-9)
        above, below = size > self.band[1], size < self.band[0]
        inertia = self.inertance / (2 * np.pi * np.maximum(size, self.lowest_mode)) ** 2
        scale = np.where(above, self.flexibility, 0.0)
        scale += np.where(below, np.minimum(inertia, 2 * self.damping * SETTINGS.largest_flexibility), 0.0)
        centre = -0.25j * np.sign(frequencies) * scale / self.damping
        radius = 0.25 * (1 + self.damping + 2 * self.damping**2) * scale / self.damping
        radius += np.where(below, self.flexibility, 0.0) + np.where(above, inertia, 0.0)
        inside = np.interp(size, self.lines, self.in_band) if len(self.lines) else np.zeros(len(size))
        radius += np.where(above | below, 0.0, inside)
        return centre, np.asarray(radius if self.cross_terms is None else radius + self.cross_terms(size))


def unmeasured_flexibility(structure: Frf | ModalModel) -> float | None:
    """Bound the static flexibility of all modes that no measurement shows, m/N; None: no band is stated.

    The value that the model states, otherwise that of :func:`unmeasured_dynamics`. A model that states no band is taken
    to hold at every frequency.

    Examples
    --------
    >>> model = ModalModel(
    ...     np.array([-2 + 100j]), np.array([[-1e-4j]]), np.ones((1, 1)) + 0j, ("T:+X",), ("T:+X",), band=(10.0, 160.0)
    ... )
    >>> f"{unmeasured_flexibility(model):.2e}"  # its receptance at 160 Hz
    '2.00e-08'
    """
    unmeasured = unmeasured_dynamics(structure)
    return None if unmeasured is None else unmeasured.flexibility


def unmeasured_dynamics(structure: Frf | ModalModel) -> UnmeasuredDynamics | None:
    """Derive the bound of the dynamics outside the band of a receptance at the tool; None: it states no band.

    Inside the band, modes above it add at least their static flexibility and modes below it the inertia line
    ``-L / w^2`` (Ewins, Modal Testing, 2nd ed., section 4.5). What modes inside the band do not explain is therefore
    fitted by ``A + B / w^2``: the flexibility is the largest singular value of A, the inertance that of B.

    - A model with out-of-band terms: these terms, and for A two standard errors of the modes at the upper edge.
    - A model without such terms: its whole receptance at the upper edge for A, and 5 % of it at the lower edge for B.
      A model that is off by more there does not hold in its band, and limits in the band shift by as much.
    - A model without such terms that states its flexibility: B = 0, as the fit of its taps showed no inertia line.
    - An FRF: its real part less that which its imaginary part in the band causes by the Kramers-Kronig relation.

    Cross terms that were not measured are bounded by the direct ones, ``|H_xy| <= sqrt(S_x S_y)`` with S the sum of the
    sizes of the modes' direct receptances: a reciprocal mode has the residue ``phi phi^T``. Of an FRF, S is derived
    from the imaginary part of the direct receptance, whose size is far less at antiresonances.
    """
    if isinstance(structure, Frf):
        structure = known_lines(to_receptance(structure))[0]
        dynamics = _of_frf(structure)
    else:
        dynamics = None if structure.band is None else _of_model(structure, structure.band)
    missing = missing_cross_terms(structure)
    if dynamics is None or not missing.any():
        return dynamics
    return replace(dynamics, cross_terms=_bound_of_cross_terms(structure, missing, dynamics))


def missing_cross_terms(structure: Frf | ModalModel) -> NDArray[np.bool_]:
    """Return the entries between measured directions of the tool that were not measured, (3, 3)."""
    if structure.measured is None:
        return np.zeros((3, 3), dtype=bool)
    known = tool_directions(structure).place(structure.measured.astype(float)) != 0
    moving = np.diag(known)
    return np.asarray(~known & moving[:, None] & moving)


def _bound_of_cross_terms(
    structure: Frf | ModalModel, missing: NDArray[np.bool_], outside: UnmeasuredDynamics
) -> Callable[[Real], Real]:
    """Return a bound of the largest singular value of ``sqrt(S_i S_j)`` over the missing entries, by its row sums."""
    sizes = _sizes_of_frf(structure, outside) if isinstance(structure, Frf) else _sizes_of_model(structure)

    def bound(frequencies: Real) -> Real:
        root = np.sqrt(sizes(frequencies))
        terms = missing * root[:, :, None] * root[:, None, :]
        return np.asarray(np.sqrt(terms.sum(axis=1).max(axis=1) * terms.sum(axis=2).max(axis=1)))

    return bound


def _sizes_of_frf(frf: Frf, outside: UnmeasuredDynamics) -> Callable[[Real], Real]:
    """Return ``|Im H|`` plus the parts of Re H that modes below and above each frequency cause, and those outside.

    In Re H itself the two parts cancel at an antiresonance; in the Kramers-Kronig integral of Im H they are apart.
    """
    known = frf.valid & (frf.frequencies > 0)
    lines, place = frf.frequencies[known], tool_directions(frf).place
    losses = np.maximum(-np.einsum("kii->ki", place(frf.values[known]).imag), 0.0)
    centres = lines[np.unique(np.linspace(0, len(lines) - 1, 3 * N_LINES).astype(int))]
    apart = np.abs(lines - centres[:, None]) > SETTINGS.least_damping * centres[:, None]
    distance = np.where(apart, np.abs(lines**2 - centres[:, None] ** 2), np.inf)
    springs = 2 / np.pi * (lines * np.gradient(lines) / distance) @ losses

    def sizes(frequencies: Real) -> Real:
        parts = ((lines, losses), (centres, springs))
        inside = sum(np.column_stack([np.interp(frequencies, at, part[:, k]) for k in range(3)]) for at, part in parts)
        inertia = outside.inertance / (2 * np.pi * frequencies) ** 2
        return np.asarray(inside + outside.flexibility + inertia[:, None])

    return sizes


def _sizes_of_model(model: ModalModel) -> Callable[[Real], Real]:
    directions, constant = tool_directions(model), with_residual_flexibility(model).residuals
    residues = directions.responses.place(model.right) * directions.excitations.place(model.left)
    rest = np.zeros(3) if constant is None else np.abs(np.diag(directions.place(constant.upper)))

    def sizes(frequencies: Real) -> Real:
        s = 2j * np.pi * frequencies[:, None, None]
        modes = residues / (s - model.poles[:, None]) + residues.conj() / (s - model.poles.conj()[:, None])
        return np.asarray(np.abs(modes).sum(axis=1) + rest)

    return sizes


def _of_model(model: ModalModel, band: Band) -> UnmeasuredDynamics:
    low, high = max(band[0], 1e-3 * band[1]), band[1]
    lowest = model.lowest_mode or 0.0
    place = tool_directions(model).place
    lines = np.linspace(low, high, N_LINES)
    if model.residuals is None:
        in_band = np.zeros(N_LINES)
        edges = np.linalg.norm(place(model.receptance(np.array([low, high]))), 2, axis=(1, 2))
        flexibility = float(edges[1])
        inertance = 0.0
        if model.unmeasured_flexibility is None and lowest < low:
            inertance = SETTINGS.largest_shift * float(edges[0]) * (2 * np.pi * low) ** 2
    else:
        constant = with_residual_flexibility(model).residuals
        assert constant is not None
        terms = place(model.residuals.receptance(np.asarray(2j * np.pi * lines)))
        in_band = np.linalg.norm(terms - place(constant.upper), 2, axis=(1, 2))
        flexibility, inertia = _two_residuals(lines, terms.real)
        flexibility += 2 * _edge_error(model, high)
        inertance = float(np.linalg.norm(inertia, 2))
        if lowest >= low:  # the fitted inertia line is noise, as no mode causes one
            rest = terms - place(constant.upper) - inertia / (2 * np.pi * lines[:, None, None]) ** 2
            in_band, inertance = np.linalg.norm(rest, 2, axis=(1, 2)), 0.0
    if model.unmeasured_flexibility is not None:
        flexibility = model.unmeasured_flexibility
    return UnmeasuredDynamics(band, flexibility, inertance, lines, in_band, SETTINGS.least_damping, lowest_mode=lowest)


def _edge_error(model: ModalModel, frequency: float) -> float:
    """Compute the standard error (Frobenius norm, m/N) of the modes' receptance at a frequency; 0 if not known."""

    def values(model: ModalModel) -> Real:
        return np.asarray(replace(model, residuals=None).receptance(np.array([frequency])).real.ravel())

    covariance = derived_covariance(model, values)
    return 0.0 if covariance is None else float(np.sqrt(max(np.trace(covariance), 0.0)))


def _two_residuals(lines: Real, values: Real) -> tuple[float, Real]:
    """Fit ``A + B / w^2`` to real matrices (n_lines, n, m); return the largest singular value of A, and B.

    For A the lines have the weights ``w^2``, as an accelerometer measures: a receptance of 20 Hz whose error is large
    says nothing about modes above the band. For B a term with ``w^2`` is fitted as well: modes not far above the band
    rise with it, and would be taken for modes below. A without that term is never below the static flexibility; two
    standard errors are added to it.
    """
    matrix, ratio = values.reshape(len(lines), -1), (lines[0] / lines) ** 2
    basis = np.column_stack([np.ones(len(lines)), ratio])
    weights = (lines / lines[-1])[:, None] ** 2
    weighted = weights * basis
    flexibility = np.linalg.lstsq(weighted, weights * matrix, rcond=None)[0]
    scatter = np.sum((weights * matrix - weighted @ flexibility) ** 2) / (len(lines) - 2)
    error = float(np.sqrt(scatter * np.linalg.inv(weighted.T @ weighted)[0, 0]))
    inertia = np.linalg.lstsq(np.column_stack([basis, 1 / ratio]), matrix, rcond=None)[0][1]
    upper = float(np.linalg.norm(flexibility[0].reshape(values.shape[1:]), 2))
    return upper + 2 * error, inertia.reshape(values.shape[1:]) * (2 * np.pi * lines[0]) ** 2


def _of_frf(frf: Frf) -> UnmeasuredDynamics | None:
    """Bound the dynamics outside the known lines of an FRF."""
    known = frf.valid & (frf.frequencies > 0)
    lines, values = frf.frequencies[known], tool_directions(frf).place(frf.values[known])
    if len(lines) < SETTINGS.least_lines:
        return None
    # near both ends the cut-off imaginary part disturbs the integral: a tenth of the band is left out there
    span = lines[-1] - lines[0]
    inner = np.flatnonzero((lines[:-1] > lines[0] + 0.1 * span) & (lines[1:] < lines[-1] - 0.1 * span))
    chosen = inner[np.unique(np.linspace(0, len(inner) - 1, min(N_LINES, len(inner))).astype(int))]
    centres = (lines[chosen] + lines[chosen + 1]) / 2
    real = (values[chosen] + values[chosen + 1]).real / 2
    flexibility, inertia = _two_residuals(centres, real - _from_imaginary(lines, values.imag, centres))
    inertance, band = float(np.linalg.norm(inertia, 2)), (float(lines[0]), float(lines[-1]))
    return UnmeasuredDynamics(band, flexibility, inertance, np.zeros(0), np.zeros(0), SETTINGS.least_damping)


def _from_imaginary(lines: Real, imaginary: Real, centres: Real) -> Real:
    """Compute ``-(2 / pi) PV integral of v Im H(v) / (v^2 - f^2) dv`` over the band at the frequencies ``centres``, Hz.

    Im H is linear between lines, so that each interval gives two logarithms; ``centres`` are in the middle of
    intervals, where the principal value of their own interval is finite.
    """
    slope = np.diff(imaginary, axis=0) / np.diff(lines)[:, None, None]
    total = np.zeros((len(centres), *imaginary.shape[1:]))
    for sign in (1.0, -1.0):  # v / (v^2 - f^2) = (1 / (v - f) + 1 / (v + f)) / 2
        pole = sign * centres
        logarithm = np.log(np.abs((lines[1:] - pole[:, None]) / (lines[:-1] - pole[:, None])))
        total += np.einsum("cn,nij->cij", logarithm, imaginary[:-1] - slope * lines[:-1, None, None])
        total += pole[:, None, None] * np.einsum("cn,nij->cij", logarithm, slope)
    regular = 2 * np.sum(np.diff(imaginary, axis=0), axis=0)
    return np.asarray(-(total + regular) / np.pi)
