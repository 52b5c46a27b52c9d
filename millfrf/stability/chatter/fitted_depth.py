"""Depth of a cut estimated from its steady motion with a model of the structure."""

import math
from dataclasses import dataclass

import numpy as np

from millfrf.core import Complex, Index, Real
from millfrf.cutting import MillingProcess, chip_forces
from modal_fit import ModalModel

from ..settings import THRESHOLDS
from ..tip_receptance import tool_receptance
from .evidence import Evidence, floor_of_mean_turn


def angles_of(process: MillingProcess) -> int:
    """Return the number of angles per revolution at which the force is computed.

    From tooth to tooth there are 96 to 600 angles; in at least 40 of them a tooth is engaged.
    """
    share = (process.exit_angle - process.start_angle) * process.teeth / (2 * math.pi)
    return process.teeth * int(min(600, max(96, math.ceil(40 / share))))


def swept_force(process: MillingProcess, motion: Real) -> Real:
    """Compute the force on the tool over depth and K_tc, m, (n_angles, 2), from a motion that repeats every revolution.

    A tooth removes the material between its path and the surface that earlier teeth left. If a tooth does not reach the
    surface, the surface remains, and the feed brings it nearer to the next tooth (Insperger & Stepan,
    Semi-Discretization for Time-Delay Systems, section 5.3).

    Parameters
    ----------
    motion : (n_angles, 2), m
        Motion of the tool in X and Y over one revolution that begins when tooth 0 is at immersion 0.

    Examples
    --------
    Without motion a slot with one tooth has the chip ``feed sin(phi)``; at 90 degrees the force is (-krc, 1) times it.

    >>> slot = MillingProcess(1, 0.01, math.pi / 2, 1e9, 0.3, 0.0, 0.0, math.pi, 1e-4)
    >>> n = angles_of(slot)
    >>> swept_force(slot, np.zeros((n, 2)))[n // 4].round(5)
    array([-3.e-05,  1.e-04])
    """
    n, teeth = len(motion), process.teeth
    pitch = n // teeth
    angles = 2 * np.pi * (np.arange(n) + 0.5) / n
    engaged = np.flatnonzero((angles >= process.start_angle) & (angles <= process.exit_angle))
    sine, cosine = np.sin(angles[engaged]), np.cos(angles[engaged])
    offsets = process.runout * np.cos(2 * np.pi * np.arange(teeth) / teeth)
    fed = process.feed_per_tooth * sine
    edge = np.array([process.kte, process.kre]) / process.ktc
    surface, force = np.zeros(len(engaged)), np.zeros((n, 2))
    for turn in range(3):  # the surface repeats from the third revolution on
        for later in range(teeth):
            instants = engaged % pitch + later * pitch
            tooth = ((engaged - instants) // pitch) % teeth
            reach = motion[instants, 0] * sine + motion[instants, 1] * cosine + offsets[tooth]
            chip = reach - surface + fed
            cuts = chip > 0
            surface = np.where(cuts, reach, surface - fed)
            if turn < 2:
                continue
            pressed = chip_forces(process, np.maximum(chip, 0.0)) / process.ktc
            tangential = np.where(cuts, pressed[:, 0] + edge[0], 0.0)
            radial = np.where(cuts, pressed[:, 1] + edge[1], 0.0)
            np.add.at(force, instants, np.column_stack([-cosine * tangential - sine * radial,
                                                        sine * tangential - cosine * radial]))  # fmt: skip
    return force


@dataclass(frozen=True)
class ModelledCut:
    """A cut, and the structure at the tool's tip.

    Parameters
    ----------
    process
        Milling process with feed and runout; equal pitch, straight edges of 90 degrees and no process damping.
    model
        Modal model of the structure at the tool's tip.
    columns
        Numbers of the channels of the tip's motion in X and Y.
    signs
        -1 for a channel that is positive against its axis, otherwise 1.
    """

    process: MillingProcess
    model: ModalModel
    columns: tuple[int, int]
    signs: tuple[int, int] = (1, 1)


@dataclass(frozen=True)
class FittedDepth:
    """Depth of cut (m) that fits the steady motion best, and its interval from noise and errors of the model."""

    depth: float
    low: float
    high: float


def fitted_depth(evidence: Evidence, cut: ModelledCut, derivatives: tuple[int, ...]) -> FittedDepth | None:
    """Find the depth at which the force that follows from the recorded motion causes this motion.

    The orders of the spindle give the tool's path, the path gives chips and force for a depth of 1 m
    (:func:`swept_force`), and the structure's receptance gives the motion that this force causes. It must equal the
    recorded motion. The unknowns are the depth, which is linear, and the spindle's angle. The standard error of the
    depth is from the jackknife over orders (Efron & Tibshirani, An Introduction to the Bootstrap, chapter 11), because
    a wrong model gives a different depth for each order.

    Return None if the cutter is of another kind, too few orders are significant, or the model does not fit.
    """
    right_angled = abs(cut.process.edge_angle - math.pi / 2) < 1e-6
    plain = cut.process.is_plain and right_angled and not cut.process.is_turning
    orders, measured = _orders(evidence, cut)
    if not plain or len(orders) < THRESHOLDS.least_orders:
        return None
    frequencies: Real = evidence.track.mean_frequency * orders.astype(float)
    derived = (2j * np.pi * frequencies[:, None]) ** np.array([derivatives[column] for column in cut.columns])
    n = angles_of(cut.process)
    path = np.zeros((n // 2 + 1, 2), dtype=complex)
    path[orders] = measured / derived
    receptance = tool_receptance(cut.model).evaluate(frequencies)[:, :2, :2] * cut.process.ktc
    motion = _SteadyMotion(
        cut.process, orders, measured, np.fft.irfft(path * n, n, axis=0), derived[:, :, None] * receptance
    )
    # 96 angles of the spindle first, then all angles around the best of them
    step = max(1, n // 96)
    best = min(motion.trial(shift) for shift in range(0, n, step))[2]
    return _best(motion, [motion.trial(best + shift) for shift in range(-2 * step, 2 * step + 1)])


@dataclass(frozen=True)
class _SteadyMotion:
    process: MillingProcess
    orders: Index
    measured: Complex  # (n_orders, 2): amplitudes of the orders
    path: Real  # (n_angles, 2), m
    gains: Complex  # (n_orders, 2, 2): amplitudes per force at a depth of 1 m

    def predicted(self, shift: int) -> Complex:
        """Compute amplitudes at a depth of 1 m with the spindle turned by ``shift`` angles, shaped as ``measured``."""
        n = len(self.path)
        force = np.fft.rfft(swept_force(self.process, np.roll(self.path, shift, axis=0)), axis=0)[self.orders] / n
        turned = np.exp(2j * np.pi * self.orders * shift / n)[:, None]
        return np.asarray(np.einsum("kij,kj->ki", self.gains, force) * turned)

    def trial(self, shift: int) -> tuple[float, float, int]:
        """Return misfit (share of the orders' power that is not explained), depth (m) and ``shift``."""
        predicted = self.predicted(shift)
        depth = float(np.vdot(predicted, self.measured).real / max(float(np.sum(np.abs(predicted) ** 2)), 1e-300))
        residual = np.sum(np.abs(self.measured - depth * predicted) ** 2)
        misfit = float(residual / np.sum(np.abs(self.measured) ** 2))
        return (misfit if depth > 0 else math.inf), depth, shift


def _jackknife(predicted: Complex, measured: Complex) -> float:
    """Compute the standard error of the depth, m, by the jackknife over orders."""
    across = np.sum((predicted.conj() * measured).real, axis=1)
    size = np.sum(np.abs(predicted) ** 2, axis=1)
    without = (across.sum() - across) / np.maximum(size.sum() - size, 1e-300)
    count = len(without)
    return float(np.sqrt((count - 1) / count * np.sum((without - without.mean()) ** 2)))


def _best(motion: _SteadyMotion, trials: list[tuple[float, float, int]]) -> FittedDepth | None:
    misfit, depth, shift = min(trials)
    if not misfit < THRESHOLDS.largest_misfit:
        return None
    accepted = [other_depth for other, other_depth, _ in trials if other <= THRESHOLDS.equal_misfit * misfit]
    error = THRESHOLDS.depth_errors * _jackknife(motion.predicted(shift), motion.measured)
    return FittedDepth(depth, max(min(accepted) - error, 0.0), max(accepted) + error)


def _orders(evidence: Evidence, cut: ModelledCut) -> tuple[Index, Complex]:
    """Return the significant orders and the tip's complex amplitudes in X and Y, in samples' units, (n_orders, 2)."""
    turn = evidence.late.mean_turn
    amplitudes = np.fft.rfft(turn, axis=0) / len(turn)
    orders = np.arange(1, min(int(0.4 * len(turn)), angles_of(cut.process) // 2 - 1) + 1)
    columns = list(cut.columns)
    floor = floor_of_mean_turn(evidence.late, evidence.spectrum, orders)
    above = (2 * np.abs(amplitudes[orders]) ** 2 / floor)[:, columns].max(axis=1) > THRESHOLDS.order_power
    scales = evidence.scales[columns] * np.array(cut.signs)
    return orders[above], amplitudes[orders[above]][:, columns] * scales
