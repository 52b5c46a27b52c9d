"""`Frf`: a matrix of frequency response functions with its axes, quality and covariance."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

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

from ..settings import FRFS
from .measured_blocks import checked_measured, entries_in_words, measured_blocks
from .selection import entries_of, select

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

QUANTITIES = ("receptance", "mobility", "accelerance", "transfer")


@dataclass(frozen=True)
class FrfCovariance:
    """Covariance of an FRF matrix on each line, as a product of two factors.

    ``E[dH[p, q] conj(dH[u, v])] = response[k, p, u] * excitation[k, q, v]``, for H1 with response noise
    spectrum S_nn and N effective averages: ``response = S_nn``, ``excitation = conj(inv(S_ff)) / N``
    (Pintelon & Schoukens, System Identification, 2nd ed., section 7.3; Bendat & Piersol, chapter 9).
    """

    response: Complex  # (n_frequencies, n_responses, n_responses)
    excitation: Complex  # (n_frequencies, n_excitations, n_excitations)

    def variance(self) -> Real:
        """Compute E|dH[p, q]|^2, shape (n_frequencies, n_responses, n_excitations)."""
        rows = np.real(np.einsum("kpp->kp", self.response))
        columns = np.real(np.einsum("kqq->kq", self.excitation))
        return np.asarray(rows[:, :, None] * columns[:, None, :])


@dataclass(frozen=True, eq=False, repr=False)
class Frf(Result):
    """Frequency response functions ``X = H F`` on a frequency axis.

    Parameters
    ----------
    frequencies : (n_frequencies,), Hz
        Frequencies of the lines, increasing.
    values : (n_frequencies, n_responses, n_excitations), complex
        The FRF matrix on each line, in ``unit``.
    responses, excitations
        Degrees of freedom along the axes, ``node:direction``.
    quantity
        ``receptance`` (m/N), ``mobility``, ``accelerance`` (m/s^2/N) or ``transfer`` (anything else).
    unit
        Unit of the response over unit of the excitation, for example ``m/N``.
    valid : (n_frequencies,), bool
        False where no FRF can be given (excitation rank below the number of inputs); every later
        step leaves those lines out. Values there are zero.
    multiple_coherence : (n_frequencies, n_responses) or None
        Multiple coherence of each response with all excitations, 0 to 1.
    covariance : FrfCovariance or None
        Covariance of the estimate; None: not known.
    band : (2,), Hz, or None
        Lowest and highest frequency between which the FRF holds; None: not known.
    coherence : (n_frequencies, n_responses, n_excitations) or None
        Ordinary coherence of each entry, 0 to 1; NaN in entries where it is not known (a single tap).
    averages : (n_responses, n_excitations), int, or None
        Number of averages behind each entry; 0 where it is not known.
    exponential_time_constant : s, or None
        Time constant tau of the window ``exp(-t / tau)`` by which force and response were multiplied; None: no such
        window. The values then belong to ``s = i w + 1/tau`` instead of the imaginary axis (:attr:`laplace`), and show
        too much damping: every pole seems ``1/tau`` further from the axis. A fit corrects this.
    spectral_width : Hz, or None
        Standard width of the segments' window in frequency, over which each line averages its neighbours. A resonance
        that is not much wider seems wider than it is. None: no segments, or not known.
    measured : (n_responses, n_excitations), bool, or None
        False for entries that were not measured, as the cross terms of a tap test in X, then in Y, with one
        accelerometer. Their values are 0, which is an assumption. The others are whole blocks, each with a drive point
        (:meth:`blocks`). None: all were measured.
    common_errors : (n_errors, n_frequencies, n_responses, n_excitations) or None
        Errors that all lines share, such as that of a length from which the FRF was computed: the derivative of the
        values by each cause, times its standard error. The causes are independent, and the covariance does not contain
        them.

    Raises
    ------
    InputError
        A quantity that is not known, degrees of freedom that are no text, shapes that do not agree, values that are
        not finite on valid lines, a coherence outside 0 to 1, a time constant that is not positive, or entries that
        were not measured but have values, or leave no whole blocks.
    """

    frequencies: Real
    values: Complex
    responses: tuple[str, ...]
    excitations: tuple[str, ...]
    quantity: str
    unit: str
    valid: NDArray[np.bool_]
    multiple_coherence: Real | None = None
    covariance: FrfCovariance | None = None
    band: Band | None = None
    coherence: Real | None = None
    averages: Index | None = None
    exponential_time_constant: float | None = None
    spectral_width: float | None = None
    measured: NDArray[np.bool_] | None = None
    common_errors: Complex | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "band", checked_band(self.band, "FRF"))
        object.__setattr__(self, "measured", checked_measured(self.measured, self.responses, self.excitations, "FRF"))
        if self.quantity not in QUANTITIES:
            raise InputError(f"FRF quantity {self.quantity!r} is not known; give one of {', '.join(QUANTITIES)}")
        for axis in (self.responses, self.excitations):
            checked_names(axis, "FRF")
        expected = (len(self.frequencies), len(self.responses), len(self.excitations))
        if self.values.shape != expected:
            raise InputError(
                f"FRF values have shape {self.values.shape}, the axes have {expected} "
                "(n_frequencies, n_responses, n_excitations); transpose or relabel"
            )
        if self.valid.shape != expected[:1]:
            raise InputError(f"FRF flag 'valid' has shape {self.valid.shape}, expected {expected[:1]}")
        if not np.isfinite(self.values[self.valid]).all():
            line = self.frequencies[self.valid][~np.isfinite(self.values[self.valid]).all(axis=(1, 2))][0]
            raise InputError(f"FRF holds NaN or infinity at {line:g} Hz; correct that line or mark it as not valid")
        if float(np.abs(self.values[self.valid]).max(initial=0.0)) >= FRFS.largest:
            raise InputError(f"FRF holds values above {FRFS.largest:g}, whose squares overflow; it is damaged")
        if self.measured is not None and self.values[:, ~self.measured].any():
            raise InputError(
                "FRF holds values in entries that were not measured; mark them as measured, or set them to 0"
            )
        _check_shapes(self, expected)
        _check_coherence(self.coherence, self.averages, self.valid)
        tau = self.exponential_time_constant
        if tau is not None and not (np.isfinite(tau) and tau > 0):
            raise InputError(
                f"time constant {tau!r} s of the exponential window must be positive; leave it out if none"
            )

    @property
    def laplace(self) -> Complex:
        """Return the Laplace variable of each line, (n_frequencies,), rad/s: ``i w``, plus ``1/tau`` for a window."""
        damping = 0.0 if self.exponential_time_constant is None else 1 / self.exponential_time_constant
        return np.asarray(2j * np.pi * self.frequencies + damping)

    @property
    def unmeasured(self) -> str:
        """Return the entries that were not measured, in words; empty where all were."""
        measured = self.measured
        return "" if measured is None else entries_in_words(measured, self.responses, self.excitations)

    def blocks(self) -> tuple["Frf", ...]:
        """Return the FRFs of the blocks that were measured, as of each direction of a tap test; else the FRF alone."""
        if self.measured is None:
            return (self,)
        return tuple(entries_of(self, rows, columns) for rows, columns in measured_blocks(self.measured))

    def sel(
        self,
        *,
        response: str | Sequence[str] | None = None,
        excitation: str | Sequence[str] | None = None,
        band: Band | None = None,
    ) -> "Frf":
        """Select entries by their names, and lines by a band.

        Parameters
        ----------
        response, excitation
            One or several degrees of freedom, in the order of the result; None: all.
        band : (low, high), Hz
            Lowest and highest frequency; None: all lines. The band of the result is the part in which the FRF holds.

        Returns
        -------
        Frf
            With the covariance, coherence and averages of its entries.

        Raises
        ------
        InputError
            A name that the FRF has not, an entry that was not measured, or a band without lines or in which the FRF
            does not hold.

        Examples
        --------
        >>> axes = ("TCP:+X", "TCP:+Y")
        >>> frf = Frf(np.arange(9.0), np.ones((9, 2, 2), complex), axes, axes, "receptance", "m/N", np.ones(9, bool))
        >>> frf.sel(response="TCP:+Y", excitation="TCP:+X", band=(2, 5))
        Frf: receptance in m/N, 1 response x 1 excitation
          4 lines, 2 to 5 Hz, 4 valid
          responses TCP:+Y
          excitations TCP:+X
        """
        return select(self, response, excitation, band)

    def entry_variance(self) -> Real | None:
        """Compute the variance ``E|dH[p, q]|^2`` of each entry from the covariance, or else from the coherence.

        From the coherence it is ``|H|^2 (1 - g^2) / (g^2 (n - 1))``, with coherence ``g^2`` over n averages and one
        input at a time, noise on the response (Bendat & Piersol, Random Data, 4th ed., section 9.2; their n is n - 1
        here, because a coherence that was estimated from the same n averages uses up one of them).

        Returns
        -------
        (n_frequencies, n_responses, n_excitations) or None
            Infinite where the coherence is 0, and NaN in entries whose coherence is not known or that have fewer than
            two averages. None where this holds for all entries.

        Examples
        --------
        >>> axis, entry = np.array([1.0, 2.0]), ("A:+X",)
        >>> coherence = np.array([0.9, 0.5]).reshape(2, 1, 1)
        >>> frf = Frf(axis, np.full((2, 1, 1), 3 + 0j), entry, entry, "mobility", "m/s/N", axis > 0,
        ...           coherence=coherence, averages=np.array([[11]]))
        >>> frf.entry_variance()[:, 0, 0]
        array([0.1, 0.9])
        """
        if self.covariance is not None:
            return self.covariance.variance()
        if self.coherence is None or self.averages is None or not (self.averages > 1).any():
            return None
        # a coherence of one average is 1 whatever the noise is
        freedom = np.where(self.averages > 1, self.averages - 1.0, np.nan)
        coherence = np.where(np.isfinite(freedom), self.coherence, np.nan)
        with np.errstate(divide="ignore", invalid="ignore"):  # the line at 0 Hz of a receptance is 0, and incoherent
            noise_to_signal = np.divide(1 - coherence, coherence)
            variance = np.abs(self.values) ** 2 * noise_to_signal / freedom
        return None if np.isnan(variance[self.valid]).all() else np.asarray(variance)

    def total_variance(self) -> Real | None:
        """Compute the variance of each entry from :meth:`entry_variance` and the errors that all lines share."""
        variance, common = self.entry_variance(), self.common_errors
        return variance if variance is None or common is None else variance + np.sum(np.abs(common) ** 2, axis=0)

    def plot(
        self,
        axes: "Axes | None" = None,
        *,
        response: str | None = None,
        excitation: str | None = None,
        part: str = "magnitude",
        quantity: str | None = None,
        **line: Any,
    ) -> "Axes":
        """Draw entries over frequency and return the axes; see `draw_frf` for the parameters."""
        return drawing("draw_frf")(
            self, axes, response=response, excitation=excitation, part=part, quantity=quantity, **line
        )

    def to_xarray(self) -> "xarray.Dataset":
        """Convert to a data set with the axes ``frequency`` (Hz), ``response`` and ``excitation``.

        The variables are named by the quantity (``receptance`` ...), ``valid``, and, where they are known,
        ``coherence``, ``multiple_coherence`` and ``variance``, and ``measured`` where entries were not.

        Raises
        ------
        InputError
            xarray is not installed.
        """
        xr = optional_library("xarray", "Frf.to_xarray")
        axes = ("frequency", "response", "excitation")
        quality = {
            "valid": (axes[:1], self.valid),
            "coherence": (axes, self.coherence),
            "multiple_coherence": (axes[:2], self.multiple_coherence),
            "variance": (axes, self.total_variance()),
            "measured": (axes[1:], self.measured),
        }
        variables = {name: variable for name, variable in quality.items() if variable[1] is not None}
        places = dict(zip(axes, (self.frequencies, list(self.responses), list(self.excitations)), strict=True))
        attributes = {"unit": self.unit} | ({} if self.band is None else {"band_hz": self.band})
        data = xr.Dataset({self.quantity: (axes, self.values, {"unit": self.unit}), **variables}, places, attributes)
        data["frequency"].attrs["unit"] = "Hz"
        return data

    def _summary(self) -> Summary:
        f, lines = self.frequencies, int(self.valid.sum())
        span = f"{f[0]:.4g} to {f[-1]:.4g} Hz" if len(f) else "no line"
        band = "" if self.band is None else f"; holds in {self.band[0]:.4g} to {self.band[1]:.4g} Hz"
        names = ("covariance", "coherence", "common_errors")
        quality = [name.replace("_", " ") for name in names if getattr(self, name) is not None]
        apart = "" if self.measured is None else f"; not measured, taken as 0: {self.unmeasured}"
        shape = f"{counted(len(self.responses), 'response')} x {counted(len(self.excitations), 'excitation')}"
        return Summary(
            f"Frf: {self.quantity} in {self.unit}, {shape}",
            (
                f"{counted(len(f), 'line')}, {span}, {lines} valid{band}",
                f"responses {listed(self.responses)}",
                f"excitations {listed(self.excitations)}"
                + (f"; with {' and '.join(quality)}" if quality else "")
                + apart,
            ),
            ("response", f"largest ({self.unit})", "at (Hz)"),
            tuple((name, *self._largest(p)) for p, name in enumerate(self.responses)),
        )

    def _largest(self, response: int) -> tuple[str, str]:
        """Return the largest magnitude of a response on valid lines, and its frequency, as texts."""
        if not self.valid.any():
            return "", ""
        magnitude = np.where(self.valid, np.abs(self.values[:, response]).max(axis=1, initial=0.0), 0.0)
        line = int(magnitude.argmax())
        return f"{magnitude[line]:.3g}", f"{self.frequencies[line]:.4g}"


def _check_shapes(frf: Frf, shape: tuple[int, int, int]) -> None:
    lines, rows, columns = shape
    covariance, common = frf.covariance, frf.common_errors
    quality: dict[str, tuple[NDArray[Any] | None, tuple[int, ...]]] = {
        "coherence": (frf.coherence, shape),
        "multiple coherence": (frf.multiple_coherence, (lines, rows)),
        "array of averages": (frf.averages, (rows, columns)),
        "response covariance": (None if covariance is None else covariance.response, (lines, rows, rows)),
        "excitation covariance": (None if covariance is None else covariance.excitation, (lines, columns, columns)),
        "array of common errors": (common, (0 if common is None else len(common), *shape)),
    }
    for name, (array, expected) in quality.items():
        if array is not None and array.shape != expected:
            raise InputError(f"FRF: {name} has shape {array.shape}, expected {expected}; estimate anew or leave it out")


def _check_coherence(coherence: Real | None, averages: Index | None, valid: NDArray[np.bool_]) -> None:
    if coherence is not None:
        wrong = coherence[valid][np.abs(coherence[valid] - 0.5) > 0.5 + FRFS.coherence_rounding]
        if len(wrong):
            raise InputError(f"a coherence of {wrong[0]:g} lies outside 0 to 1; estimate anew or leave it out")
    if averages is not None and (averages < 0).any():
        raise InputError(f"{averages.min()} averages; give the number of averages of each entry, 0 if not known")
