"""Trial of learned postures: do 95 % bands hold, and what are they worth beside simpler ways?

Run it: `python benchmarks/posture_trial.py FIRST LAST [POSTURES] [NEW]`, seeds FIRST to LAST - 1, a number of measured
postures (12), and of new ones (6). Each seed draws a cell whose joints stiffen under load and over
their angle, with friction that grows with load; its model errs in masses and springs and knows nothing of the tool's
compliance. Four ways predict frequency, damping and depth limit in postures that were not measured:

- learned: the process about the model (this package);
- updated: the same with factors that are the same in every posture;
- nearest: what was measured in the nearest posture;
- plain: a Gaussian process over joint angles without the model (scikit-learn).
"""

import sys
from dataclasses import dataclass

import numpy as np
from measured_cell import MODES, MeasuredCell, measured_cell, true_model
from nonlinear_cell import drawn_postures
from numpy.typing import NDArray
from plain_process import PlainProcess, plain_process

from millfrf.cutting import MillingProcess
from millfrf.robot_model import LearnedPostures, learn_postures, predict_posture
from millfrf.robot_model.posture_process.learning import assembled
from millfrf.robot_model.posture_process.modal_basis import mode_pairs
from millfrf.robot_model.posture_process.process import MEDIANS, best_hyperparameters, drawn_hyperparameters
from millfrf.stability import lowest_limits
from millfrf.steps.robot.learned import depth_band
from modal_fit import ModalModel

Real = NDArray[np.float64]

CUT = MillingProcess(2, 0.02, np.pi / 2, 700e6, 0.3, 0.1, np.pi / 2, np.pi, 1e-4)
SPEED = np.array([3000 * np.pi / 30])
DEEPEST = 0.05
SAMPLES = 39
"""Draws of a depth limit: the smallest and the largest hold the next one with 38 / 40 = 95 %."""

QUANTITIES = ("frequency", "damping", "depth")


@dataclass(frozen=True)
class Compared:
    """Predictions beside truths, as logarithms.

    Parameters
    ----------
    errors, low, high : (n,)
        Prediction less truth, and ends of the 95 % band less truth; NaN where there is no band.
    """

    errors: Real
    low: Real
    high: Real

    @property
    def coverage(self) -> float:
        """Share of bands that hold the truth."""
        return float(np.mean((self.low <= 0) & (self.high >= 0)))

    @property
    def error(self) -> float:
        """Root of the mean squared logarithm of predicted over true."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def half_width(self) -> float:
        """Median of half the band's width."""
        return float(np.median(self.high - self.low)) / 2


Found = dict[str, dict[str, list[tuple[float, float, float]]]]
"""By way and quantity: (error, low, high) of every prediction."""


def depth_of(model: ModalModel) -> float:
    """Depth limit of a model at the speed of the trial, m."""
    return float(min(lowest_limits(model, CUT, SPEED, DEEPEST).lowest().depth_limits[0], DEEPEST))


def trial(seeds: range, postures: int = 12, new: int = 6, depths: bool = True) -> Found:
    """All four ways on cells of the seeds; ``depths``: depth limits too."""
    result: Found = {
        way: {name: [] for name in QUANTITIES} for way in ("learned", "updated", "nearest", "plain", "as modelled")
    }
    for seed in seeds:
        cell = measured_cell(seed, postures)
        learned = learn_postures(cell.robot, cell.measured)
        ways = {"learned": learned, "updated": updated(learned)}
        plain = plain_process(cell.postures, cell.models, depth_of if depths else None)
        for q in drawn_postures(np.random.default_rng([seed, 1]), new):
            truth = true_model(cell.cell, q)
            depth = depth_of(truth) if depths else np.nan
            for way, process in ways.items():
                _predicted(result[way], process, q, truth, depth)
            _nearest(result["nearest"], cell, learned, q, truth, depth)
            _plain(result["plain"], plain, q, truth, depth)
        print(f"seed {seed} done", file=sys.stderr, flush=True)
    return result


def updated(learned: LearnedPostures) -> LearnedPostures:
    """The same measurements with factors that are the same in every posture: a plain update of the model."""
    start = np.log(MEDIANS)
    fixed = np.array([1, 3, 5, 9])
    start[fixed] = np.log(1e-5)
    best = best_hyperparameters(learned.evidence, start, fixed)
    draws = drawn_hyperparameters(learned.evidence, best, fixed=fixed)
    return assembled(learned.robot, learned.measured, learned.pairs, (best, draws), (learned.stiffness, learned.mass))


def _predicted(
    into: dict[str, list[tuple[float, float, float]]],
    process: LearnedPostures,
    q: Real,
    truth: ModalModel,
    depth: float,
) -> None:
    result = predict_posture(process, q)
    model = result.model
    pairs = mode_pairs(
        truth.natural_frequencies[:MODES], truth.right.real[:MODES], model.natural_frequencies, model.right.real
    )
    frequency, damping = result.frequency_band(), result.damping_band()
    for i, r in pairs:
        f, z = truth.natural_frequencies[i], truth.damping_ratios[i]
        into["frequency"].append(_logs(model.natural_frequencies[r], frequency[:, r], f))
        into["damping"].append(_logs(model.damping_ratios[r], damping[:, r], z))
    if np.isfinite(depth):
        band = depth_band(result.draws, CUT, SPEED, DEEPEST, SAMPLES)
        into["depth"].append(_logs(band.middle[0], np.array([band.low[0], band.high[0]]), depth))


def _nearest(
    into: dict[str, list[tuple[float, float, float]]],
    cell: MeasuredCell,
    learned: LearnedPostures,
    q: Real,
    truth: ModalModel,
    depth: float,
) -> None:
    steps = 2 * np.sin((cell.postures - q) / 2) * learned.metric.weights
    model = cell.models[int(np.argmin(np.sum(steps**2, axis=1)))]
    none = np.full(2, np.nan)
    for i in range(MODES):
        into["frequency"].append(_logs(model.natural_frequencies[i], none, truth.natural_frequencies[i]))
        into["damping"].append(_logs(model.damping_ratios[i], none, truth.damping_ratios[i]))
    if np.isfinite(depth):
        into["depth"].append(_logs(depth_of(model), none, depth))


def _plain(
    into: dict[str, list[tuple[float, float, float]]], plain: PlainProcess, q: Real, truth: ModalModel, depth: float
) -> None:
    for i in range(MODES):
        into["frequency"].append(_logs(*plain.frequency(i, q), truth.natural_frequencies[i]))
        into["damping"].append(_logs(*plain.damping(i, q), truth.damping_ratios[i]))
    if np.isfinite(depth):
        into["depth"].append(_logs(*plain.depth(q), depth))


def _logs(middle: float, ends: Real, truth: float) -> tuple[float, float, float]:
    low, high = (float(np.log(max(end, 1e-12) / truth)) if np.isfinite(end) else np.nan for end in ends)
    return float(np.log(middle / truth)), low, high


def compared(found: Found, way: str, quantity: str) -> Compared:
    """One cell of the table."""
    columns = np.array(found[way][quantity], dtype=float).reshape(-1, 3).T
    return Compared(*columns)


def main(first: int, last: int, postures: int = 12, new: int = 6) -> None:
    """Print the table."""
    result = trial(range(first, last), postures, new)
    print(f"{last - first} cells, {postures} postures measured, {new} new ones each")
    print(f"{'way':12}{'quantity':12}{'number':>8}{'error (%)':>11}{'half band (%)':>15}{'coverage (%)':>14}")
    for way in ("learned", "updated", "nearest", "plain"):
        for quantity in QUANTITIES:
            single = compared(result, way, quantity)
            if not len(single.errors):
                continue
            band = (
                "" if np.isnan(single.half_width) else f"{100 * single.half_width:15.2f}{100 * single.coverage:14.1f}"
            )
            print(f"{way:12}{quantity:12}{len(single.errors):8d}{100 * single.error:11.2f}{band}")
