"""Cuts in production with their verdicts, and what a structure predicts of them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import Index, InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from ..chatter.verdict import CHATTER, INCONCLUSIVE, STABLE, KeptCut
from ..drawn_structures import Draw
from ..edge_ends import edge_end_effect
from ..floquet.multipliers import check_cut, largest_multipliers
from ..milling_loop import delay_system
from ..settings import LEARNING, THRESHOLDS


@dataclass(frozen=True)
class ProductionCut:
    """A cut at one depth and speed, and whether it chattered.

    Parameters
    ----------
    name
        Name of the cut, for messages.
    spindle_speed : rad/s
        Spindle speed of the cut.
    depth : m
        Axial depth of cut.
    verdict
        ``stable``, ``hopf``, ``period-doubling`` or ``inconclusive``.
    frequency : Hz
        Frequency of the chatter, not folded; NaN: not known.
    frequency_error : Hz
        Standard error of the frequency.
    immersion : (2,), rad
        Immersion angles at which a tooth enters and leaves; None: those of the cutting file.
    left_by_edges
        Share of the depth limit that the moving ends of edge forces leave (:func:`with_edge_ends`).

    Raises
    ------
    InputError
        A speed or depth that is not positive, an unknown verdict, or a frequency of a stable cut.
    """

    name: str
    spindle_speed: float
    depth: float
    verdict: str
    frequency: float = math.nan
    frequency_error: float = 0.0
    immersion: tuple[float, float] | None = None
    left_by_edges: float = 1.0

    def __post_init__(self) -> None:
        try:
            check_cut(self.spindle_speed, self.depth)
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from error
        known = (STABLE, *CHATTER, INCONCLUSIVE)
        if self.verdict not in known:
            raise InputError(f"{self.name}: verdict {self.verdict!r} is not known; use one of {', '.join(known)}")
        if not self.depth > 0:
            raise InputError(f"{self.name}: depth {self.depth!r} m must be above 0; give metres, such as 0.002")
        if not math.isnan(self.frequency) and not (math.isfinite(self.frequency) and self.frequency > 0):
            raise InputError(f"{self.name}: chatter frequency {self.frequency!r} Hz must be above 0, or empty")
        if not (math.isfinite(self.frequency_error) and self.frequency_error >= 0):
            raise InputError(f"{self.name}: error {self.frequency_error!r} Hz of the frequency must be 0 or more")

    @classmethod
    def of(cls, kept: KeptCut, depth: float) -> "ProductionCut":
        """Return a judged cut at its depth (m); the error of its frequency is that of a line of its spectrum."""
        judged, spacing = kept.cut, np.diff(kept.spectrum.frequencies)
        error = THRESHOLDS.line_error * float(np.median(spacing)) if len(spacing) else 0.0
        verdict = judged.verdict
        return cls(judged.name, judged.rpm * math.pi / 30, depth, verdict.kind, verdict.frequency, error)

    @property
    def chatters(self) -> bool:
        """Return whether the verdict is chatter."""
        return self.verdict in CHATTER

    def process(self, process: MillingProcess) -> MillingProcess:
        """Return the process with this cut's immersion."""
        if self.immersion is None:
            return process
        return replace(process, start_angle=self.immersion[0], exit_angle=self.immersion[1])


@dataclass(frozen=True)
class Prediction:
    """What structures predict of cuts: one row a structure, one column a cut.

    Parameters
    ----------
    growth : (n_draws, n_cuts)
        Logarithm of the largest multiplier's modulus: above 0 the cut chatters.
    place : (n_draws, n_cuts)
        Argument of the largest multiplier over 2 pi, 0 to 1/2: the lines of the chatter are ``(k +- place) / period``.
    period : (n_cuts,), s
        Period of the cut, which the multiplier belongs to.
    """

    growth: Real
    place: Real
    period: Real

    def of_draws(self, chosen: Index) -> "Prediction":
        """Return the rows of the chosen draws."""
        return Prediction(self.growth[chosen], self.place[chosen], self.period)

    def with_draws(self, rows: Index, other: "Prediction") -> "Prediction":
        """Return the prediction with some rows from another one."""
        growth, place = self.growth.copy(), self.place.copy()
        growth[rows], place[rows] = other.growth, other.place
        return Prediction(growth, place, self.period)

    def with_cut(self, other: "Prediction") -> "Prediction":
        """Return the columns of both."""
        parts = ("growth", "place", "period")
        return Prediction(*(np.concatenate([getattr(self, part), getattr(other, part)], axis=-1) for part in parts))


def with_edge_ends(
    model: ModalModel, process: MillingProcess, cuts: Sequence[ProductionCut], max_depth: float
) -> list[ProductionCut]:
    """Return cuts with the share of the limit that the moving ends of edge forces leave at their speeds.

    Multipliers neglect these ends, which lower limits (:func:`millfrf.stability.edge_end_effect`): a cut is predicted
    as one of the depth over this share. Where the effect is not known, the share is 1.

    Parameters
    ----------
    model, process
        Structure and cut of the prior.
    cuts
        Cuts in production.
    max_depth : m
        Largest depth that is searched for limits.
    """
    changed = []
    for cut in cuts:
        effect = edge_end_effect(model, cut.process(process), np.array([cut.spindle_speed]), max_depth)
        share = 1.0 if effect is None else 1.0 - effect.lowered
        changed.append(replace(cut, left_by_edges=share))
    return changed


def predicted(draws: Sequence[Draw], cuts: Sequence[ProductionCut]) -> Prediction:
    """Compute the largest multiplier of each cut for each structure."""
    values, period = np.empty((len(draws), len(cuts)), dtype=complex), np.empty(len(cuts))
    immersions = {
        cut.immersion: [k for k, other in enumerate(cuts) if other.immersion == cut.immersion] for cut in cuts
    }
    speeds = np.array([cut.spindle_speed for cut in cuts])
    depths = np.array([cut.depth / cut.left_by_edges for cut in cuts])
    for row, (structure, process) in enumerate(draws):
        for chosen in immersions.values():
            system = delay_system(structure, cuts[chosen[0]].process(process))
            values[row, chosen], period[chosen] = largest_multipliers(system, speeds[chosen], depths[chosen])
    growth = np.log(np.maximum(np.abs(values), 1e-300))
    return Prediction(growth, np.abs(np.angle(values)) / (2 * np.pi), period)


def chatter_probability(prediction: Prediction) -> Real:
    """Return the probability that each cut chatters, ``Phi(growth / s)``: near 0 it is not decided."""
    return np.asarray(scipy.special.ndtr(prediction.growth / LEARNING.undecided_growth))


def log_likelihood(prediction: Prediction, cuts: Sequence[ProductionCut]) -> Real:
    """Return the logarithm of the probability of each cut's verdict and frequency, (n_draws, n_cuts).

    ``p(stable) = e + (1 - 2 e) Phi(-g / s)`` with the growth g and the probability e of a wrong verdict. Chatter with
    its frequency has the density ``(1 - 2 e) Phi(g / s) [o + (1 - o) N] + e``, N the normal density about the nearest
    predicted line over that of any frequency, and o the probability that the frequency is of other lines.
    """
    wrong, other = LEARNING.wrong_verdict, LEARNING.other_line
    result = np.zeros_like(prediction.growth)
    for k, (cut, chatters) in enumerate(zip(cuts, chatter_probability(prediction).T, strict=True)):
        if not cut.chatters:
            result[:, k] = np.log(wrong + (1 - 2 * wrong) * (1 - chatters))
            continue
        relative = np.ones(len(chatters))
        if not math.isnan(cut.frequency):
            relative = other + (1 - other) * _line_density(prediction, k, cut)
        result[:, k] = np.log(wrong + (1 - 2 * wrong) * chatters * relative)
    return result


def _line_density(prediction: Prediction, k: int, cut: ProductionCut) -> Real:
    """Return the density of the measured line, folded to 0 ... 1/2 of 1 / period, over the even density there."""
    measured, error = folded_line(prediction, k, cut)
    images = [sign * prediction.place[:, k] + turn for sign in (-1, 1) for turn in (-1, 0, 1)]
    density = sum(np.exp(-0.5 * ((measured - image) / error) ** 2) for image in images)
    return np.asarray(0.5 * density / (error * math.sqrt(2 * math.pi)))


def folded_line(prediction: Prediction, k: int, cut: ProductionCut) -> tuple[float, Real]:
    """Return the measured line as a share of 1 / period, folded to 0 ... 1/2, and its error for each structure.

    The linear theory holds at the limit. Above it teeth leave the cut, and the frequency moves the more the faster the
    vibration would grow.
    """
    turns = cut.frequency * prediction.period[k]
    measured = abs(turns - round(turns))
    share = LEARNING.line_at_limit + LEARNING.line_above_limit * np.maximum(prediction.growth[:, k], 0.0)
    error = np.hypot(cut.frequency_error, share * cut.frequency) * prediction.period[k]
    return measured, np.asarray(error)


def other_line_probability(prediction: Prediction, cuts: Sequence[ProductionCut]) -> Real:
    """Return the probability that each chatter frequency is none of the predicted ones, (n_draws, n_cuts).

    NaN without a frequency.
    """
    result, other = np.full_like(prediction.growth, np.nan), LEARNING.other_line
    for k, cut in enumerate(cuts):
        if cut.chatters and not math.isnan(cut.frequency):
            result[:, k] = other / (other + (1 - other) * _line_density(prediction, k, cut))
    return result
