"""One model of the tip from two tests: in-process modes in the band of the cut, tapped modes outside it."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from estimation import Frf
from millfrf.core import Band, Complex, Index, InputError, Real, shared_band

from ..models.modal_model import BandSource, ModalModel
from ..models.out_of_band import Residuals
from ..models.synthesis import derived_covariance, pack_parameters
from ..settings import SETTINGS
from .agreement import SensorAgreement
from .mapping import real_parts
from .mode_sets import chosen_modes, with_modes
from .rest_and_cut import RestAndCut, rest_and_cut
from .tapped import in_the_cut


@dataclass(frozen=True)
class TappedBand:
    """Bands of a calibration, Hz.

    Parameters
    ----------
    in_process
        Band whose modes are those of the cut; None: not known.
    fitted
        Band of the hammer fit; it contains the in-process modes.
    usable
        Band of the fit in which the taps are known.
    extends
        Whether tapped modes are added outside ``in_process``.
    warnings
        Why they are not, one sentence each.
    """

    in_process: Band | None
    fitted: Band
    usable: Band
    extends: bool
    warnings: tuple[str, ...] = ()

    @property
    def seam(self) -> float:
        """Highest frequency of in-process modes; infinite where no tapped modes follow."""
        return self.in_process[1] if self.extends and self.in_process is not None else np.inf


def tapped_band(
    model: ModalModel, tip: Frf, sensor: Frf, band: Band | None, tip_above: float | None, *, complete: bool
) -> TappedBand:
    """Find the bands of the cut and of the taps.

    Parameters
    ----------
    model
        In-process model.
    tip, sensor
        Hammer FRFs.
    band
        Band of the hammer fit, or None.
    tip_above : Hz
        Where the tapped band is to begin, or None.
    complete
        Whether the taps excite all directions of the model.

    Raises
    ------
    InputError
        Bands with nothing in common, or ``tip_above`` outside the band of the taps.
    """
    natural = model.natural_frequencies
    span = (float(natural.min()), float(natural.max()))
    stated = shared_band(tip.band, sensor.band)
    in_process = shared_band(model.band, stated)
    fitted = band or _fitted_band(tip, sensor, span, max(span[1], (in_process or span)[1]))
    usable = shared_band(fitted, stated) or fitted
    if tip_above is not None:
        _check_seam(in_process or span, usable, tip_above, complete=complete)
        return TappedBand(((in_process or span)[0], tip_above), fitted, usable, extends=True)
    reach = SETTINGS.band_reach
    wider = in_process is not None and (usable[1] > reach * in_process[1] or usable[0] < in_process[0] / reach)
    if model.band is None or not wider:
        return TappedBand(in_process, fitted, usable, extends=False)
    incomplete = (
        f"the taps excite {', '.join(tip.excitations)}, the cut {', '.join(model.excitations)}: tapped modes are not "
        "added outside the band of the cut; tap along each direction"
    )
    return TappedBand(in_process, fitted, usable, extends=complete, warnings=() if complete else (incomplete,))


def _fitted_band(tip: Frf, sensor: Frf, span: Band, top: float) -> Band:
    """Return the band of the hammer fit: that of the taps, up to a multiple of that of the cut, and the modes' span.

    The span is widened, so that modes of a structure that is stiffer or softer at rest lie inside.
    """
    lines = tip.frequencies[tip.valid & sensor.valid & (tip.frequencies > 0)]
    stated = shared_band(tip.band, sensor.band)
    low, high = SETTINGS.span_of_matches[0] * span[0], SETTINGS.span_of_matches[1] * span[1]
    if stated is not None:
        low, high = min(low, stated[0]), max(high, stated[1])
    elif len(lines):
        high = max(high, float(lines[-1]))
    high = min(high, SETTINGS.tapped_above * top)
    return (low, high) if not len(lines) else (max(low, float(lines[0])), min(high, float(lines[-1])))


def _check_seam(in_process: Band, usable: Band, tip_above: float, *, complete: bool) -> None:
    if not complete:
        raise InputError(
            f"tip_above {tip_above:g} Hz needs taps along every direction of the model's forces; tap along each, or "
            "leave --tip-above out"
        )
    low = max(in_process[0], usable[0])
    if not low < tip_above < usable[1]:
        raise InputError(
            f"tip_above {tip_above:g} Hz is not between {low:.4g} Hz, where cut and taps begin, and {usable[1]:.4g} "
            "Hz, where the taps end; choose a frequency between them"
        )


def hybrid_model(
    carried: ModalModel,
    hammer: ModalModel,
    tip_modes: ModalModel,
    agreement: SensorAgreement,
    taps: TappedBand,
    residuals: Residuals | None,
    right_by_hammer: Callable[[ModalModel], Complex],
) -> tuple[ModalModel, tuple[str, ...]]:
    """Add the tapped modes outside the band of the cut; return the model and warnings.

    The in-process residuals contain what these modes add in the band of the cut, so that those of the tip's own FRF
    take their place.

    Parameters
    ----------
    carried
        In-process modes at the tip, without residuals.
    hammer
        Fit of both hammer FRFs.
    tip_modes
        Its modes at the tip.
    agreement
        Comparison of the two tests.
    taps
        Bands of both.
    residuals
        What the modes of the taps leave of the tip's FRF.
    right_by_hammer
        Right vectors of ``carried`` as a function of the hammer fit.
    """
    assert taps.in_process is not None
    change = rest_and_cut(agreement)
    outside, unmatched = _free_modes(hammer, agreement.hammer_modes, change, taps.in_process)
    model = carried
    if len(outside):
        tapped = in_the_cut(chosen_modes(tip_modes, outside), change)
        model = with_modes(carried, tapped, _shared_covariance(carried, hammer, outside, change, right_by_hammer))
    sources = _band_sources(model, taps)
    model = replace(model, residuals=residuals, sources=sources, band=(sources[0].low, sources[-1].high))
    warnings = _unmatched_warnings(tip_modes, unmatched)
    return model, (*warnings, *_seam_warnings(model, in_the_cut(tip_modes, change), taps.in_process, taps.usable))


def _band_sources(model: ModalModel, taps: TappedBand) -> tuple[BandSource, ...]:
    """Return the bands by their measurement; those of the taps contain their modes as they are in the cut."""
    assert taps.in_process is not None
    low, seam = taps.in_process
    sources = [BandSource(low, seam, "in-process")]
    if taps.usable[0] < low:
        sources.insert(0, BandSource(min(taps.usable[0], float(model.natural_frequencies.min())), low, "tapped"))
    if taps.usable[1] > seam:
        sources.append(BandSource(seam, max(taps.usable[1], float(model.natural_frequencies.max())), "tapped"))
    return tuple(sources)


def _free_modes(hammer: ModalModel, chosen: Index, change: RestAndCut, inside: Band) -> tuple[Index, Index]:
    """Split hammer modes that no in-process mode took: outside the band of the cut, and inside it.

    Frequencies are compared as they are expected in the cut.
    """
    free = np.setdiff1d(np.arange(len(hammer.poles)), chosen)
    expected = np.abs(change.poles(hammer.poles[free])) / (2 * np.pi)
    beyond = (expected < inside[0]) | (expected > inside[1])
    return free[beyond], free[~beyond]


def _shared_covariance(
    carried: ModalModel,
    hammer: ModalModel,
    outside: Index,
    change: RestAndCut,
    right_by_hammer: Callable[[ModalModel], Complex],
) -> Real | None:
    """Return the covariance of carried and tapped modes, which share the errors of the hammer fit."""
    n, p = len(carried.poles), carried.right.shape[1]

    def both(m: ModalModel) -> Real:
        factors = change.residue_factors(m.poles[outside])
        tapped = replace(
            m,
            poles=change.poles(m.poles[outside]),
            right=m.right[outside] * factors[:, None],
            left=m.left[outside],
            covariance=None,
            errors=None,
        )
        tapped = replace(tapped, right=tapped.right[:, :p], responses=m.responses[:p], residuals=None)
        return np.concatenate([real_parts(right_by_hammer(m)), pack_parameters(tapped)])

    covariance = derived_covariance(hammer, both)
    if covariance is None:
        return None
    size = 2 * n * p
    shared = np.zeros((len(pack_parameters(carried)), len(covariance) - size))
    shared[2 * n : 2 * n + size] = covariance[:size, size:]
    return shared


def _unmatched_warnings(tip_modes: ModalModel, unmatched: Index) -> tuple[str, ...]:
    """Name the modes that only the taps show in the band of the cut, with their share of the largest peak."""
    sizes = np.linalg.norm(tip_modes.right, axis=1) * np.linalg.norm(tip_modes.left, axis=1)
    shares = sizes / np.abs(tip_modes.poles.real)
    shares = shares / shares.max()
    return tuple(
        f"only the taps show a mode at {tip_modes.natural_frequencies[r]:.4g} Hz, in the band of the cut, with "
        f"{100 * shares[r]:.2g} % of the largest peak at the tip: the cut did not excite it, or the fit joined it with "
        "another; it is not in the model"
        for r in unmatched
        if shares[r] > SETTINGS.noticed_peak
    )


def _seam_warnings(model: ModalModel, tapped: ModalModel, inside: Band, usable: Band) -> tuple[str, ...]:
    """Compare the modes of the model with those of the taps alone, in the cut, where the bands of both meet.

    Raises
    ------
    InputError
        A jump larger than the receptance itself, beyond its error.
    """
    warnings = []
    met = (usable[0] < inside[0], usable[1] > inside[1])
    for seam in np.array(inside)[list(met)]:
        here, here_error = _receptance_with_error(replace(model, residuals=None), seam)
        there, there_error = _receptance_with_error(tapped, seam)
        size = float(np.linalg.norm(here))
        jump, error = float(np.linalg.norm(here - there)) / size, float(np.hypot(here_error, there_error)) / size
        if jump < max(SETTINGS.significant_change * error, SETTINGS.seam_jump):
            continue
        text = (
            f"at {seam:.4g} Hz, where the band of the cut meets that of the taps, their receptances differ by "
            f"{100 * jump:.2g} ± {100 * error:.1g} % of their size"
        )
        if jump > 1:
            raise InputError(
                f"{text}: the fit of the cut lacks a mode near it, or they are of two structures; fit a wider band, or "
                "tap the structure as it was cut"
            )
        warnings.append(f"{text}: a mode is missing on one side, or the structure changes; compare both in the report")
    return tuple(warnings)


def _receptance_with_error(model: ModalModel, frequency: float) -> tuple[Complex, float]:
    """Return the receptance at one frequency and the standard error of its Frobenius norm; 0 where not known."""
    at = np.array([frequency])
    covariance = derived_covariance(model, lambda m: real_parts(m.receptance(at)))
    return model.receptance(at)[0], 0.0 if covariance is None else float(np.sqrt(np.trace(covariance)))
