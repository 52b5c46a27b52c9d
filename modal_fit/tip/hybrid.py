"""One model of the tip from two tests: in-process modes, and tapped modes that the cut does not show."""

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
from .tapped import in_the_cut, static_flexibility


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
    """Add the tapped modes that the cut does not show; return the model and warnings.

    Outside the band of the cut these are all, inside it those in which the tip moves beyond its error; the static
    flexibility of the others is part of the bound.

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
    free = np.setdiff1d(np.arange(len(hammer.poles)), agreement.hammer_modes)
    inside, unclear = _inside(tip_modes, free, change, taps.in_process)
    added, model = np.setdiff1d(free, unclear), carried
    if len(added):
        tapped = in_the_cut(chosen_modes(tip_modes, added), change)
        model = with_modes(carried, tapped, _shared_covariance(carried, hammer, added, change, right_by_hammer))
    sources = _band_sources(model, taps, np.abs(change.poles(hammer.poles[inside])) / (2 * np.pi))
    bound = (carried.unmeasured_flexibility or 0.0) + static_flexibility(chosen_modes(tip_modes, unclear))
    model = replace(
        model,
        residuals=residuals,
        sources=sources,
        band=(sources[0].low, sources[-1].high),
        unmeasured_flexibility=bound,
    )
    warnings = _inside_warnings(tip_modes, inside)
    return model, (*warnings, *seam_warnings(model, in_the_cut(tip_modes, change), taps.in_process, taps.usable))


def _band_sources(model: ModalModel, taps: TappedBand, inside: Real) -> tuple[BandSource, ...]:
    """Return the bands by their measurement; those of the taps contain their modes as they are in the cut.

    A tapped mode ``inside`` the band of the cut (Hz) has the band between its half-power points there, up to half way
    to the next mode of the cut.
    """
    assert taps.in_process is not None
    low, seam = taps.in_process
    natural = model.natural_frequencies
    own = natural[(natural >= low) & (natural <= seam) & ~np.isin(natural, inside)]
    edges: list[Band] = []
    for f in np.sort(inside):
        half = min(float(model.damping_ratios[np.abs(natural - f).argmin()]) * f, *np.abs(own - f) / 2, np.inf)
        start = max(f - half, edges[-1][1] if edges else low)
        edges.append((float(start), float(min(f + half, seam))))
    sources = [BandSource(start, end, "tapped") for start, end in edges]
    ends = [low, *(end for edge in edges for end in edge), seam]
    sources += [BandSource(start, end, "in-process") for start, end in zip(ends[::2], ends[1::2], strict=True)]
    if taps.usable[0] < low:
        sources.append(BandSource(min(taps.usable[0], float(natural.min())), low, "tapped"))
    if taps.usable[1] > seam:
        sources.append(BandSource(seam, max(taps.usable[1], float(natural.max())), "tapped"))
    return tuple(sorted((source for source in sources if source.low < source.high), key=lambda source: source.low))


def _inside(tip_modes: ModalModel, free: Index, change: RestAndCut, band: Band) -> tuple[Index, Index]:
    """Split tapped modes expected in the band of the cut by whether the tip moves in them beyond its error."""
    expected = np.abs(change.poles(tip_modes.poles[free])) / (2 * np.pi)
    inside = free[(expected >= band[0]) & (expected <= band[1])]
    clear = np.array([_is_significant(chosen_modes(tip_modes, np.array([mode]))) for mode in inside], dtype=bool)
    return inside[clear], inside[~clear]


def _is_significant(mode: ModalModel) -> bool:
    def residue(m: ModalModel) -> Real:
        return real_parts(m.right[0][:, None] * m.left[0])

    covariance = derived_covariance(mode, residue)
    if covariance is None:
        return True
    return bool(np.linalg.norm(residue(mode)) > SETTINGS.significant_change * np.sqrt(np.trace(covariance)))


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


def _inside_warnings(tip_modes: ModalModel, inside: Index) -> tuple[str, ...]:
    """Name the modes that only the taps show in the band of the cut, with their share of the largest peak."""
    sizes = np.linalg.norm(tip_modes.right, axis=1) * np.linalg.norm(tip_modes.left, axis=1)
    shares = sizes / np.abs(tip_modes.poles.real)
    shares = shares / shares.max()
    return tuple(
        f"only the taps show a mode at {tip_modes.natural_frequencies[r]:.4g} Hz, in the band of the cut, with "
        f"{100 * shares[r]:.2g} % of the largest peak at the tip: it is added as tapped; the cut did not excite it, or "
        "the fit joined it with another: fit the cut with one mode more"
        for r in inside
        if shares[r] > SETTINGS.noticed_peak
    )


def seam_warnings(model: ModalModel, tapped: ModalModel, inside: Band, usable: Band) -> tuple[str, ...]:
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
