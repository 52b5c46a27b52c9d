"""`fit_polyreference`: modal model of an FRF matrix, with stabilisation, residuals and error bars."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Complex, InputError, MillfrfError, Result, Summary

from .frf_fit.fit import NOT_REFINED, REFINED, MatrixFit, fit_matrix
from .frf_fit.steady_poles import default_order
from .maximum_likelihood.likelihood_fit import regressors
from .maximum_likelihood.likelihood_model import Setting
from .maximum_likelihood.whole_records import RecordSpectra
from .models.modal_model import ModalModel
from .models.out_of_band import out_of_band_basis
from .models.synthesis import fit_summary
from .stabilisation import PoleGroup, StabilisationChart, choose_poles, matrix_fraction_poles, stabilisation_chart

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_LONGEST = 4.0  # periods of the band's upper end
_GRID = 160


def transfer_delay(poles: Complex, spectra: RecordSpectra, band: tuple[float, float]) -> float:
    """Find the delay tau (s) for which modes at ``poles`` and out-of-band terms explain ``H(s) exp(s tau)`` best.

    A delay of a fraction of a period turns the phase of a mode far from its resonance, which no modal model of
    few terms can follow. With the poles held, everything but tau is linear and is eliminated: the misfit left is a
    function of tau alone, searched on a grid and then refined.

    Parameters
    ----------
    poles : (n_modes,), rad/s
        Poles that are held, in the upper half plane.
    spectra
        Spectra of a ``transfer``.
    band : Hz
        Lowest and highest frequency of the lines.
    """
    setting = Setting(spectra, out_of_band_basis(spectra.s, band), np.zeros((0, len(spectra.s))))
    design = regressors(poles, setting, 0, 0)
    design = np.concatenate([design.real, design.imag])
    orthogonal, _ = np.linalg.qr(design / np.linalg.norm(design, axis=0))
    size = np.sqrt(np.mean(np.abs(spectra.response) ** 2, axis=0))
    response = spectra.response / np.where(size > 0, size, 1.0)

    def misfit(delay: float) -> float:
        advanced = response * np.exp(spectra.s * delay)[:, None]
        return -float(np.sum((orthogonal.T @ np.concatenate([advanced.real, advanced.imag])) ** 2))

    delays = np.linspace(0.0, _LONGEST / band[1], _GRID)
    best = int(np.argmin([misfit(delay) for delay in delays]))
    step = delays[1]
    around = (delays[best] - step, delays[best] + step)
    found = scipy.optimize.minimize_scalar(misfit, bounds=around, method="bounded", options={"xatol": 1e-5 * step})
    return float(max(found.x, 0.0))


_NO_VIBRATION = 0.5  # damping ratio above which a pole is taken for a trend
_DELAY_ROUNDS = 4  # the first poles are found with the delay still in


@dataclass(frozen=True, eq=False, repr=False)
class ModalFit(Result):
    """A modal model with the evidence for it.

    Parameters
    ----------
    model
        Modal model: modes, residuals and covariance.
    chart
        Stabilisation chart: poles over order.
    dropped
        Groups of poles that were not taken for modes, each with its reason.
    band : Hz
        Lowest and highest frequency of the fit.
    reduced_chi_square
        Misfit over what the noise explains; 1 is perfect, much above 1 means more than noise is left. NaN
        where the FRF came without a covariance.
    relative_error : (n_responses, n_excitations)
        Root mean square misfit over root mean square FRF in the band.
    warnings
        Doubts about the fit, one sentence each.
    status
        ``refined``, or ``poly-reference poles`` where the refinement did not hold on lines that it had not seen.
    """

    model: ModalModel
    chart: StabilisationChart
    dropped: tuple[PoleGroup, ...]
    band: tuple[float, float]
    reduced_chi_square: float
    relative_error: NDArray[np.float64]
    warnings: tuple[str, ...]
    status: str = REFINED

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw the FRF that the model gives and return the axes; see `draw_model` for the choices."""
        return self.model.plot(axes, **choices)

    def _summary(self) -> Summary:
        chi_square = "not known" if np.isnan(self.reduced_chi_square) else f"{self.reduced_chi_square:.3g}"
        note = f"fit of {self.band[0]:.4g} to {self.band[1]:.4g} Hz, reduced chi-square {chi_square}"
        return fit_summary("ModalFit", self.model, (note,), self.warnings)


def fit_polyreference(
    frf: Frf, band: tuple[float, float], *, max_order: int | None = None, n_modes: int | None = None
) -> ModalFit:
    """Fit a modal model to the valid lines of an FRF matrix inside ``band`` (Hz).

    Poles come from the poly-reference least-squares complex frequency method over all orders. Each is tried in its
    neighbourhood and stays where the data need it. Poles and the vectors of the references are then refined together;
    all that belongs to one response is eliminated (variable projection), in the quantity that was measured and weighted
    by its noise. Where the FRF has a covariance, that is the noise; terms for modes outside the band are then as few
    as it allows.

    Parameters
    ----------
    frf
        Receptance, mobility, accelerance or a transfer; the first three give a receptance model.
    band
        Hz, 0 < low < high.
    max_order
        Highest order of the denominator; None: from the number of lines and references.
    n_modes
        Keep the first ``n_modes`` that are found; None: as many as there are.

    Raises
    ------
    InputError
        A band without enough valid lines, or an order below 2.
    MillfrfError
        No pole is stable over the orders.
    """
    inside = usable_lines(frf, band, max_order)
    references = min(len(frf.responses), len(frf.excitations))
    order = default_order(int(inside.sum()), references) if max_order is None else max_order
    order = min(order, int(inside.sum()) // 2)
    delay, advanced = 0.0, frf
    if frf.quantity == "transfer":
        delay = _delay(frf, band, order, inside, n_modes)
        advanced = without_delay(frf, delay)
    fit = fit_matrix(advanced, inside, band, order, n_modes)
    model = replace(fit.model, delay=delay)
    error = relative_error(frf, model, inside)
    chi = fit.chi_square if frf.covariance is not None else float("nan")
    warnings = (*status_warnings(fit), *fit_warnings(frf, inside, model, band, chi, error))
    return ModalFit(model, fit.chart, fit.refused, band, chi, error, warnings, fit.status)


def _delay(frf: Frf, band: tuple[float, float], order: int, inside: NDArray[np.bool_], n_modes: int | None) -> float:
    """Delay of a transfer, found in turn with its poles."""
    delay = 0.0
    poles = _first_poles(frf, band, order, n_modes)
    lines = flat_lines(frf, inside)
    for number in range(_DELAY_ROUNDS):
        found, before = transfer_delay(poles, lines, band), delay
        delay = found if number < 2 else (found + before) / 2  # poles and delay can swing about their common value
        poles = _first_poles(without_delay(frf, delay), band, order, n_modes)
        if abs(delay - before) < 1e-3 / band[1]:
            break
    return delay


def _first_poles(frf: Frf, band: tuple[float, float], order: int, n_modes: int | None) -> Complex:
    """Poles that many orders have, without a refinement."""
    chart = stabilisation_chart(list(matrix_fraction_poles(frf, band, order)), band)
    kept, _ = choose_poles(chart)
    if not kept:
        raise MillfrfError(
            f"no pole is stable over orders 1 to {order} between {band[0]:g} and {band[1]:g} Hz; "
            "widen the band, raise max_order (--max-order) or average more"
        )
    return np.array([group.pole for group in sorted(kept, key=_minus_orders)[:n_modes]])


def without_delay(frf: Frf, delay: float) -> Frf:
    """The FRF with a delay taken out."""
    return replace(frf, values=frf.values * np.exp(2j * np.pi * frf.frequencies * delay)[:, None, None])


def _minus_orders(group: PoleGroup) -> int:
    return -group.n_orders


def status_warnings(fit: MatrixFit) -> tuple[str, ...]:
    """Give the warnings of the refinement."""
    if fit.status == NOT_REFINED:
        return (
            "the refinement does not hold on lines left out of it: the poles are those of the poly-reference method",
        )
    if not fit.converged:
        return ("the refinement stopped before it converged; treat the error bars as lower bounds",)
    return ()


def usable_lines(frf: Frf, band: tuple[float, float], max_order: int | None) -> NDArray[np.bool_]:
    """Valid lines in a band; refused where they are too few, or where the band or the order makes no sense."""
    low, high = band
    if not 0 < low < high:
        raise InputError(f"band {low:g} to {high:g} Hz is empty or starts at 0; give 0 < low < high")
    if max_order is not None and max_order < 2:
        raise InputError(f"highest order {max_order} leaves no room for a mode; give 2 or more")
    inside = frf.valid & (frf.frequencies >= low) & (frf.frequencies <= high)
    if inside.sum() < 8:
        raise InputError(
            f"{inside.sum()} valid lines between {low:g} and {high:g} Hz (file: {frf.frequencies[0]:g} to "
            f"{frf.frequencies[-1]:g} Hz) are too few to fit; widen the band or use longer segments"
        )
    return np.asarray(inside)


def flat_lines(frf: Frf, inside: NDArray[np.bool_]) -> RecordSpectra:
    """The FRF as responses to unit excitations, one column of it after the other."""
    values = frf.values[inside]
    n_lines, n_responses, n_excitations = values.shape
    excitation = np.tile(np.eye(n_excitations, dtype=complex), (n_lines, 1))
    return RecordSpectra(
        np.repeat(2j * np.pi * frf.frequencies[inside], n_excitations),
        np.zeros(n_lines * n_excitations, dtype=np.int64),
        excitation,
        np.ascontiguousarray(values.transpose(0, 2, 1).reshape(-1, n_responses)),
        np.zeros(n_responses, dtype=np.int64),
    )


def relative_error(frf: Frf, model: ModalModel, inside: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Root mean square misfit over root mean square FRF, in the measured quantity, (n_responses, n_excitations)."""
    s = frf.laplace[inside]
    factor = s ** {"mobility": 1, "accelerance": 2}.get(frf.quantity, 0)
    misfit = frf.values[inside] - factor[:, None, None] * model.at(s)
    size = np.sqrt(np.mean(np.abs(frf.values[inside]) ** 2, axis=0))
    return np.asarray(np.sqrt(np.mean(np.abs(misfit) ** 2, axis=0)) / np.where(size > 0, size, 1.0))


def fit_warnings(
    frf: Frf,
    inside: NDArray[np.bool_],
    model: ModalModel,
    band: tuple[float, float],
    chi: float,
    error: NDArray[np.float64],
) -> tuple[str, ...]:
    """Give the doubts that lines, misfit and poles of a fit raise, one sentence each."""
    warnings = []
    asked = (frf.frequencies >= band[0]) & (frf.frequencies <= band[1])
    if inside.sum() < asked.sum():
        warnings.append(
            f"{asked.sum() - inside.sum()} of {asked.sum()} lines in the band have no FRF (dependent inputs) "
            "and were left out"
        )
    if chi > 2:
        warnings.append(
            f"the misfit is {chi:.1f} times what the noise explains: a mode, leakage or a nonlinearity is left"
        )
    if error.max() > 0.3:
        p, q = np.unravel_index(int(error.argmax()), error.shape)
        warnings.append(
            f"{frf.responses[p]} / {frf.excitations[q]} is fitted to {100 * error.max():.0f} % only: "
            "the entry is weak or noisy"
        )
    outside = (model.natural_frequencies < band[0]) | (model.natural_frequencies > band[1])
    if outside.any():
        warnings.append(f"{outside.sum()} mode(s) moved out of the band during refinement; widen the band")
    return tuple(warnings)
