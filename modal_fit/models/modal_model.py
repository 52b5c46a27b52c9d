"""`ModalModel`: poles, left and right vectors, residuals, and standard errors of its modes."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, checked_measured, entries_in_words
from millfrf.core import (
    Band,
    Complex,
    Index,
    InputError,
    Real,
    Result,
    Summary,
    checked_band,
    checked_names,
    counted,
    drawing,
    listed,
    optional_library,
)

from .out_of_band import Residuals

if TYPE_CHECKING:
    import pandas
    from matplotlib.axes import Axes


@dataclass(frozen=True)
class ModeErrors:
    """Standard errors of each mode: column 0 of the natural frequency (Hz), column 1 of the damping ratio.

    ``total^2 = max(noise, points)^2 + band^2 + terms^2``. The scatter over the points contains the noise, so that only
    the larger of the two counts.

    Parameters
    ----------
    noise : (n_modes, 2)
        Standard errors from the noise of the FRF, or from the misfit where that is larger, and from the errors that all
        lines of the FRF share.
    points : (n_modes, 2)
        Jackknife over the responses: change of the result when single responses are left out. NaN with fewer than four
        responses.
    band : (n_modes, 2)
        Root mean square change when an edge of the band moves inwards by a twentieth of the band. NaN where no edge can
        move.
    terms : (n_modes, 2)
        Root mean square change with other out-of-band terms.
    """

    noise: Real
    points: Real
    band: Real
    terms: Real

    @property
    def total(self) -> Real:
        """Return the total standard errors from all sources, shape (n_modes, 2).

        Examples
        --------
        >>> noise = np.array([[3.0, 0.3]])
        >>> ModeErrors(noise, np.full((1, 2), np.nan), 4 * noise / 3, 0 * noise).total.round(3).tolist()
        [[5.0, 0.5]]
        """
        scatter = np.fmax(self.noise, self.points)
        return np.asarray(np.sqrt(scatter**2 + np.nan_to_num(self.band) ** 2 + np.nan_to_num(self.terms) ** 2))

    @property
    def frequency(self) -> Real:
        """Return the total standard errors of the natural frequencies, Hz, shape (n_modes,)."""
        return np.asarray(self.total[:, 0])

    @property
    def damping(self) -> Real:
        """Return the total standard errors of the damping ratios, shape (n_modes,)."""
        return np.asarray(self.total[:, 1])

    def ordered(self, order: Index) -> "ModeErrors":
        """Return the errors of the modes in the order of the indices ``order``."""
        return ModeErrors(self.noise[order], self.points[order], self.band[order], self.terms[order])


@dataclass(frozen=True)
class BandSource:
    """Band in which a model holds because of one kind of measurement.

    Parameters
    ----------
    low, high : Hz
        Lowest and highest frequency of the band.
    source
        Measurement that the modes in the band come from: ``in-process`` or ``tapped``.
    """

    low: float
    high: float
    source: str


@dataclass(frozen=True, eq=False, repr=False)
class ModalModel(Result):
    """Modal model of a linear structure that need not be reciprocal.

    ``H(w)[p, q] = sum_r right[r, p] left[r, q] / (i w - pole[r]) + conjugate term + residuals``
    (Mohammadi & Ahmadi, Eq. 15; Ewins, Modal Testing, 2nd ed., section 2.7). ``left`` is not conjugated.

    Parameters
    ----------
    poles : (n_modes,), rad/s
        Poles with positive imaginary part: the upper half of the conjugate pairs.
    right : (n_modes, n_responses)
        Right vectors (mode shapes at the responses).
    left : (n_modes, n_excitations)
        Left vectors (participation of the excitations). Right times left has the unit of the FRF times rad/s.
    responses, excitations
        Degrees of freedom along the axes, ``node:direction``.
    quantity, unit
        Quantity and unit of the FRF of the model: ``receptance`` in ``m/N``, or ``transfer`` in any unit.
    residuals
        Out-of-band terms, or None.
    covariance : (n_parameters, n_parameters) or None
        Covariance of the real numbers Re poles, Im poles, Re right, Im right, Re left, Im left, each laid out row by
        row (mode by mode), in SI units.
    physics
        Terms ``{name, location, parameters}`` that a diagnosis added; empty for a linear model.
    delay : s
        Pure delay of the measuring chain: the whole expression is multiplied by ``exp(-i w delay)``. Only a
        ``transfer`` has one, whose input passes converters and amplifiers; a structure has none.
    band : (2,), Hz, or None
        Lowest and highest frequency between which the model holds, usually the band of its fit; None: not known.
        Programs that use the model outside the band report it.
    errors
        Standard errors of frequencies and damping ratios by their source; None: only ``covariance`` is known.
    sources
        Adjoining bands, by rising frequency, with the kind of measurement that each comes from; empty: not stated.
    unmeasured_flexibility : m/N, or None
        Upper bound of the static flexibility of all modes together that no measurement shows (largest singular
        value); None: not stated.
    lowest_mode : Hz, or None
        Frequency below which the user states that no mode lies; None: not stated.
    measured : (n_responses, n_excitations), bool, or None
        False for entries of the fitted FRF that were not measured: the model is 0 there, which is an assumption. None:
        all were measured.

    Raises
    ------
    InputError
        Degrees of freedom that are no text, shapes that do not agree, values that are not finite, or a pole in the
        lower half plane.
    """

    poles: Complex
    right: Complex
    left: Complex
    responses: tuple[str, ...]
    excitations: tuple[str, ...]
    quantity: str = "receptance"
    unit: str = "m/N"
    residuals: Residuals | None = None
    covariance: Real | None = None
    physics: tuple[dict[str, Any], ...] = ()
    delay: float = 0.0
    band: Band | None = None
    errors: ModeErrors | None = None
    sources: tuple[BandSource, ...] = ()
    unmeasured_flexibility: float | None = None
    lowest_mode: float | None = None
    measured: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "band", checked_band(self.band, "modal model"))
        measured = checked_measured(self.measured, self.responses, self.excitations, "modal model")
        object.__setattr__(self, "measured", measured)
        for axis in (self.responses, self.excitations):
            checked_names(axis, "modal model")
        n_modes = len(self.poles)
        if self.delay and self.quantity != "transfer":
            raise InputError(
                f"modal model: a {self.quantity} has no delay ({self.delay:g} s given); only a transfer has"
            )
        _check_shapes(self)
        for name, array in (("poles", self.poles), ("right", self.right), ("left", self.left)):
            if not np.isfinite(array).all():
                raise InputError(f"modal model: {name} hold NaN or infinity; fit again or correct the file")
        edges = [edge for band in self.sources for edge in (band.low, band.high)]
        if edges != sorted(edges):
            raise InputError(f"modal model: bands of sources overlap ({listed([str(edge) for edge in edges])} Hz)")
        if n_modes and self.poles.imag.min() < 0:
            raise InputError(
                f"modal model: pole {self.poles[self.poles.imag.argmin()]:.4g} has a negative imaginary part; "
                "give the upper half of each conjugate pair"
            )

    @property
    def natural_frequencies(self) -> Real:
        """Return the undamped natural frequencies ``|pole| / 2 pi``, Hz, shape (n_modes,)."""
        return np.abs(self.poles) / (2 * np.pi)

    @property
    def damping_ratios(self) -> Real:
        """Return the damping ratios ``zeta = -Re(pole) / |pole|`` of the modes, shape (n_modes,)."""
        return -self.poles.real / np.abs(self.poles)

    @property
    def unmeasured(self) -> str:
        """Return the entries that were not measured, in words; empty where all were."""
        measured = self.measured
        return "" if measured is None else entries_in_words(measured, self.responses, self.excitations)

    @property
    def mode_sources(self) -> tuple[str, ...]:
        """Return the kind of measurement that each mode comes from; empty texts where it is not stated."""
        return tuple(
            next((band.source for band in self.sources if band.low <= f <= band.high), "")
            for f in self.natural_frequencies
        )

    def receptance(self, frequencies: Real) -> Complex:
        """Evaluate H on ``frequencies`` (Hz); shape (n_frequencies, n_responses, n_excitations), in ``unit``.

        Raises
        ------
        InputError
            A frequency of zero where the model has a lower residual (it is infinite there).
        """
        return self.at(2j * np.pi * np.atleast_1d(np.asarray(frequencies, dtype=float)))

    def at(self, s: Complex) -> Complex:
        """Evaluate H anywhere in the Laplace plane (rad/s); shape (n_values, n_responses, n_excitations)."""
        n_modes, n, m = len(self.poles), self.right.shape[1], self.left.shape[1]
        residues = (self.right[:, :, None] * self.left[:, None, :]).reshape(n_modes, n * m)
        # one matrix product: einsum would search for the best contraction order at each call
        fractions = 1 / (s[:, None] - np.concatenate([self.poles, self.poles.conj()]))
        values = np.asarray(fractions @ np.concatenate([residues, residues.conj()]), dtype=complex).reshape(-1, n, m)
        if self.residuals is not None:
            values += self.residuals.receptance(s)
        return values * np.exp(-s * self.delay)[:, None, None] if self.delay else values

    def frf(self, frequencies: Real) -> Frf:
        """Evaluate the model on ``frequencies`` (Hz) as an :class:`estimation.Frf`, valid on every line."""
        axis = np.asarray(frequencies, dtype=float)
        valid = np.ones(len(axis), dtype=bool)
        labels = (self.responses, self.excitations)
        values, kind = self.receptance(axis), (self.quantity, self.unit)
        return Frf(axis, values, *labels, *kind, valid, band=self.band, measured=self.measured)

    def standard_errors(self) -> tuple[Real, Real] | None:
        """Return standard errors of natural frequencies (Hz) and damping ratios, (n_modes,) each; None if not known.

        They come from ``errors`` where the model has it. Otherwise ``f = |p| / 2 pi`` and ``zeta = -Re p / |p|`` are
        linearised at each pole ``p``, with the covariance, which contains only the noise.
        """
        if self.errors is not None:
            return self.errors.frequency, self.errors.damping
        if self.covariance is None:
            return None
        n, size = len(self.poles), np.abs(self.poles)
        a, b = self.poles.real / size, self.poles.imag / size
        blocks = self.covariance[: 2 * n, : 2 * n].reshape(2, n, 2, n)
        own = np.einsum("irjr->rij", blocks)  # covariance of real and imaginary part of each pole
        slopes = np.stack([[a / (2 * np.pi), b / (2 * np.pi)], [-(b**2) / size, a * b / size]])
        variances = np.einsum("kir,rij,kjr->kr", slopes, own, slopes)
        frequency, damping = np.sqrt(np.maximum(variances, 0.0))  # rounding may make a variance slightly negative
        return frequency, damping

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw the FRF of the model and return the axes; see `draw_model` for the choices."""
        return drawing("draw_model")(self, axes, **choices)

    def to_frame(self) -> "pandas.DataFrame":
        """Give one row a mode: natural frequency (Hz), damping ratio and, where known, one standard error of each.

        Summaries and reports show two standard errors.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        columns = {"natural_frequency_hz": self.natural_frequencies, "damping_ratio": self.damping_ratios}
        errors = self.standard_errors()
        if errors is not None:
            columns |= {"natural_frequency_standard_error_hz": errors[0], "damping_ratio_standard_error": errors[1]}
        pd = optional_library("pandas", "ModalModel.to_frame")
        return pd.DataFrame(columns, index=pd.RangeIndex(1, len(self.poles) + 1, name="mode"))

    def _summary(self) -> Summary:
        frequencies, damping = self.natural_frequencies, 100 * self.damping_ratios
        band = "" if self.band is None else f", holds in {self.band[0]:.4g} to {self.band[1]:.4g} Hz"
        terms = "" if self.residuals is None else "; with out-of-band terms"
        terms += f"; physics {listed([str(term.get('name')) for term in self.physics])}" if self.physics else ""
        apart = "" if self.measured is None else f"; not measured, taken as 0: {self.unmeasured}"
        columns: tuple[str, ...] = ("mode", "frequency (Hz)", "damping ratio (%)")
        cells = [[f"{f:.5g}" for f in frequencies], [f"{zeta:.3g}" for zeta in damping]]
        errors = self.standard_errors()
        if errors is not None:
            columns = (*columns[:2], "± 2 standard errors", columns[2], "± 2 standard errors")
            spread = [[f"{2 * error:.2g}" for error in errors[0]], [f"{200 * error:.2g}" for error in errors[1]]]
            cells = [cells[0], spread[0], cells[1], spread[1]]
        return Summary(
            f"ModalModel: {counted(len(self.poles), 'mode')}, {self.quantity} in {self.unit}{band}",
            (
                f"modes {listed(modes_in_short(frequencies, damping)) or 'none'}{terms}",
                f"responses {listed(self.responses)}",
                f"excitations {listed(self.excitations)}{apart}",
            ),
            columns,
            tuple((str(r + 1), *row) for r, row in enumerate(zip(*cells, strict=True))),
        )


def _check_shapes(model: ModalModel) -> None:
    n_modes, n, m = len(model.poles), len(model.responses), len(model.excitations)
    for name, array, expected in (("right", model.right, (n_modes, n)), ("left", model.left, (n_modes, m))):
        if array.shape != expected:
            raise InputError(
                f"modal model: {name} vectors have shape {array.shape}, expected {expected} (n_modes, n_dof)"
            )
    for name, errors in ({} if model.errors is None else vars(model.errors)).items():
        if errors.shape != (n_modes, 2):
            raise InputError(
                f"modal model: errors {name!r} have shape {errors.shape}, expected {(n_modes, 2)}; fit again"
            )
    size = 2 * n_modes * (1 + n + m)
    if model.covariance is not None and model.covariance.shape != (size, size):
        raise InputError(
            f"modal model: covariance has shape {model.covariance.shape}, expected {(size, size)}; fit again"
        )


def modes_in_short(frequencies: Real, damping: Real) -> list[str]:
    """Name each mode by its natural frequency (Hz) in four digits and its damping ratio (%) in three.

    >>> modes_in_short(np.array([52.0]), np.array([4.0]))
    ['52.00 Hz 4.00 %']
    """
    pairs = zip(frequencies, damping, strict=True)
    return [f"{f'{f:#.4g}'.rstrip('.')} Hz {f'{zeta:#.3g}'.rstrip('.')} %" for f, zeta in pairs]
