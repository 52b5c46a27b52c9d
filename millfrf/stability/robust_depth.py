"""Depth that stays stable whatever modes outside the measured band do, by the small-gain theorem."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance
from millfrf.core import Complex, Index, Real
from millfrf.cutting import MillingProcess, directional_harmonics, directional_matrix, edge_slices
from modal_fit import ModalModel

from .floquet.collocated_period import period_operator
from .floquet.cut_period import collocated_cut
from .floquet.growth import leading_multipliers
from .floquet.multipliers import monodromies
from .lobes_result import StabilityLobes
from .milling_loop import DelaySystem, delay_system
from .sensitivity import limit_sensitivities, structure_receptance
from .settings import SETTINGS
from .tip_receptance import tool_directions
from .unmeasured import UnmeasuredDynamics, unmeasured_dynamics


@dataclass(frozen=True)
class UnmeasuredGain:
    """Largest gain of the loop that unmeasured modes close through a cut, over all multipliers on the unit circle.

    Parameters
    ----------
    gain
        Below 1: no unmeasured mode within the bound destabilises the cut.
    frequency : Hz
        Line of the motion at which unmeasured modes have the largest effect; NaN without an effect.
    """

    gain: float
    frequency: float


# Share of what unmeasured dynamics take that one part of them has to give back to be named, and how many times as much
# as any other part.
LARGE_PART, TIMES_OTHERS = 0.1, 2.0


def largest_unmeasured_part(
    structure: Frf | ModalModel, process: MillingProcess, unmeasured: UnmeasuredDynamics, speed: float, depth: float
) -> tuple[str, float]:
    """Return which part of the unmeasured dynamics takes most of a depth, and the frequency at which it does so, Hz.

    The parts are ``cross`` terms, modes ``below`` and ``above`` the band, and the error of out-of-band terms
    ``inside`` it: that without which most of the depth is left; ``several`` if none of them alone gives back a tenth of
    what they take together, and twice as much as any other.

    Parameters
    ----------
    structure
        Modal model or FRF at the tool tip.
    process
        Cut with equal pitch; straight or helical edges.
    unmeasured
        Bound of the unmeasured dynamics.
    speed : rad/s
        Spindle speed of the cut.
    depth : m
        Axial depth that is stable without them.
    """
    without = {
        "cross": replace(unmeasured, cross_terms=None),
        "below": replace(unmeasured, inertance=0.0),
        "above": replace(unmeasured, flexibility=0.0),
        "inside": replace(unmeasured, in_band=np.zeros_like(unmeasured.in_band)),
    }
    left = {name: RobustCut(structure, process, part).depth(speed, depth) for name, part in without.items()}
    whole = RobustCut(structure, process, unmeasured)
    largest, of_all = max(left, key=lambda name: left[name]), whole.depth(speed, depth)
    frequency = whole.gain(speed, max(of_all, SETTINGS.robust_step * depth)).frequency
    *_, second, most = sorted(each - of_all for each in left.values())
    alone = most > LARGE_PART * (depth - of_all) and most > TIMES_OTHERS * second
    return largest if alone else "several", frequency


class RobustCut:
    """Cut of a measured structure with unmeasured modes.

    On the unit circle, the motion at the lines ``f_q`` of a cut obeys ``X = (H + D) c G X`` with the depth a,
    ``c = a (1 - exp(-i theta))``, G the harmonics of ``K_tc alpha``, H the measured receptance and D the unmeasured
    one. D lies in a disc: ``D = d + r E`` with a norm of E of at most 1 (:meth:`UnmeasuredDynamics.discs`). With
    ``M = c G (I - (H + d) c G)^-1`` no multiplier reaches the circle if ``|sqrt(r) M sqrt(r)| < 1`` for every theta
    (small-gain theorem; Zhou, Doyle & Glover, Robust and Optimal Control, chapter 9). D = 0 belongs to the modes that
    are considered, and its multipliers are inside the circle, so all multipliers of all structures are.

    Parameters
    ----------
    structure, process
        Modal model or FRF at the tool, and a cut with equal pitch; straight or helical edges.
    unmeasured
        Bound of the unmeasured dynamics.
    """

    def __init__(self, structure: Frf | ModalModel, process: MillingProcess, unmeasured: UnmeasuredDynamics) -> None:
        structure = to_receptance(structure) if isinstance(structure, Frf) else structure
        self.process, self.unmeasured = process, unmeasured
        self._receptance, _ = structure_receptance(structure, process)
        self._system: DelaySystem | None = None
        if isinstance(structure, ModalModel):
            self._system = delay_system(structure, process)
        place = tool_directions(structure)
        angles = np.linspace(0, 2 * np.pi / process.teeth, 721)
        force = process.ktc * directional_matrix(process, angles)
        seen = np.flatnonzero(np.abs(force).max(axis=(0, 1)) > 1e-12 * np.abs(force).max())
        self._motion = np.intersect1d(place.responses.axes, seen)
        self._force = np.unique(place.excitations.axes)
        acting = force[:, self._force][:, :, self._motion]
        self._largest_force = float(np.linalg.norm(acting, 2, axis=(1, 2)).max()) if acting.size else 0.0
        if not process.is_cylinder:  # all teeth at once, with the largest width of the edge per depth
            shallow = 1e-3 * process.diameter
            width = float(edge_slices(process, shallow).widths.sum()) / shallow
            self._largest_force = process.teeth * process.largest_stiffness * width

    @property
    def highest_depth(self) -> float:
        """Depth (m) from which a mode with the whole unmeasured flexibility alone can be unstable at some speed.

        ``2 z / ((1 + z + 2 z^2) |K_tc alpha| u)`` with the largest norm over the immersion: the loop of one mode is 1
        there, by the least real part of its disc. It bounds the depth where the motion has infinitely many lines.
        """
        damping, flexibility = self.unmeasured.damping, self.unmeasured.flexibility
        gain = self._largest_force * flexibility * (1 + damping + 2 * damping**2)
        return 2 * damping / gain if gain > 0 else np.inf

    def least_depths(self, speeds: Real) -> Real:
        """Return depths (m) below which unmeasured dynamics alone are stable at the speeds (rad/s), whatever the edges.

        The smaller of :attr:`highest_depth` and of that at which the gain over the frequencies up to the band's upper
        edge is 1, where a tooth that meets the waves of the one before by the time T makes ``|1 - exp(-i w T)|`` of a
        motion.
        """
        edges = np.geomspace(1e-3, 1.0, 600) * self.unmeasured.band[1]
        lines = np.unique(np.concatenate([edges, self.unmeasured.lines]))
        centre, radius = self.unmeasured.discs(lines)
        waves = np.minimum(2.0, np.outer(max(self.process.pitches) / speeds, 2 * np.pi * lines))
        gain = self._largest_force * (waves * (np.abs(centre) + radius)).max(axis=1)
        alone = np.divide(1.0, gain, out=np.full(len(speeds), np.inf), where=gain > 0)
        return np.asarray(np.minimum(self.highest_depth, alone))

    def gain(self, speed: float, depth: float) -> UnmeasuredGain:
        """Compute the largest gain at a speed (rad/s) and depth (m) over the upper half of the unit circle.

        In turning over all frequencies.
        """
        passing = self.process.teeth * speed / (2 * np.pi)
        theta = self._angles(speed, depth)
        orders = self._orders(passing, theta, depth)
        harmonics = self._harmonics(orders, depth)
        gains = self._gains(theta, passing, depth, orders, harmonics)
        for _ in range(2):  # finer around the highest peaks
            if not SETTINGS.small_gain <= gains.max() < 1:
                break
            peaks = np.argsort(gains)[-3:]
            left, right = theta[np.maximum(peaks - 1, 0)], theta[np.minimum(peaks + 1, len(theta) - 1)]
            finer = np.setdiff1d(np.linspace(left, right, 9).ravel(), theta)
            more = self._gains(finer, passing, depth, orders, harmonics)
            order = np.argsort(np.concatenate([theta, finer]))
            theta, gains = np.concatenate([theta, finer])[order], np.concatenate([gains, more])[order]
        worst = int(np.argmax(gains))
        if gains[worst] == 0:
            return UnmeasuredGain(0.0, np.nan)
        [matrix], open_lines = self._loop(theta[worst : worst + 1], passing, depth, orders, harmonics)
        strongest = np.linalg.norm(np.linalg.svd(matrix)[2][0].reshape(len(open_lines), -1), axis=1)
        line = passing * (theta[worst] / (2 * np.pi) + open_lines[np.argmax(strongest)])
        return UnmeasuredGain(float(gains[worst]), float(abs(line)))

    def depth(self, speed: float, depth: float) -> float:
        """Return the largest depth (m) up to ``depth``, stable without unmeasured modes, that they leave stable."""
        top = min(depth, self.highest_depth)
        high = 1.0
        for low in SETTINGS.robust_shares:
            if self.gain(speed, low * top).gain < 1:
                break
            high = low
        else:
            return 0.0
        while high - low > SETTINGS.robust_step * high:
            middle = (low + high) / 2
            low, high = (low, middle) if self.gain(speed, middle * top).gain >= 1 else (middle, high)
        return low * top

    def _orders(self, passing: float, theta: Real, depth: float) -> Index:
        """Return the orders of the lines at which the loop is not negligible.

        The loop over all other lines together is at most ``2 a |K_tc alpha|`` times their largest receptance.
        """
        if self.process.is_turning:  # constant coefficients couple no lines
            return np.zeros(1, dtype=int)
        share = (self.process.exit_angle - self.process.start_angle) * self.process.teeth / (2 * np.pi)
        reach = self.unmeasured.band[1] / passing + 2 + 3 / share  # beyond the band, where modes are not measured
        count = int(np.ceil(min(reach, SETTINGS.robust_lines)))
        orders = np.arange(-count, count)  # theta adds up to half a line: symmetric on the whole
        lines = passing * (theta[:, None] / (2 * np.pi) + orders)
        centre, radius = self.unmeasured.discs(lines.ravel())
        size = np.linalg.norm(self._receptance(lines.ravel()), axis=(1, 2)) + np.abs(centre) + radius
        loop = 2 * depth * self._largest_force * size.reshape(lines.shape).max(axis=0)
        return np.asarray(orders[loop >= SETTINGS.negligible_loop])

    def _harmonics(self, orders: Index, depth: float) -> Complex:
        """Return the matrix G from motion to force at all lines, N/m per m of depth."""
        spread = orders[:, None] - orders[None, :]
        needed = np.arange(spread.min(initial=0), spread.max(initial=0) + 1)
        alpha = self.process.ktc * directional_harmonics(self.process, needed, depth)[spread - needed[0]]
        chosen = alpha[:, :, self._force][:, :, :, self._motion]
        rows, columns = len(orders) * len(self._force), len(orders) * len(self._motion)
        return np.asarray(chosen.transpose(0, 2, 1, 3).reshape(rows, columns))

    def _angles(self, speed: float, depth: float) -> Real:
        """Return angles that resolve the resonances of the cut: in (0, pi] the arguments of its multipliers.

        In turning each frequency stands alone, and the angles go on to where the unmeasured dynamics no longer matter.
        """
        if self.process.is_turning:
            waves = 2 * np.pi * self.unmeasured.band[1] / speed
            count = int(np.ceil(4 * SETTINGS.robust_angles * max(1.0, waves / np.pi)))
            lines = 2 * np.pi * self.unmeasured.lines / speed
            return np.unique(np.concatenate([np.linspace(0, 2 * waves, 2 * count + 1)[1:], lines[lines > 0]]))
        # the resonances of an FRF are not known beforehand
        count = SETTINGS.robust_angles * (1 if self._system is not None else 3)
        angles = [np.linspace(0, np.pi, count + 1)[1:], np.geomspace(1e-4, 0.1, 7)]
        if self._system is not None:
            values = self._multipliers(self._system, speed, depth)
            for value in values[(np.abs(values) > 0.3) & (values.imag >= 0)]:
                width = max(-float(np.log(np.abs(value))), 1e-4)
                angles.append(np.angle(value) + width * np.sinh(np.linspace(-2, 2, 7)))
        joined = np.concatenate(angles)
        return np.unique(joined[(joined > 1e-5) & (joined <= np.pi)])

    def _multipliers(self, system: DelaySystem, speed: float, depth: float) -> Complex:
        """Compute the multipliers of the cut above 0.3, or all."""
        if not self.process.is_plain:
            return leading_multipliers(collocated_cut(system, speed, depth), floor=0.3).values
        operator = period_operator(system, np.array([2 * np.pi / (self.process.teeth * speed)]))
        monodromy = monodromies(operator, np.zeros(1, dtype=np.int64), np.array([depth]))[0]
        return np.asarray(np.linalg.eigvals(monodromy), dtype=complex)

    def _gains(self, theta: Real, passing: float, depth: float, orders: Index, harmonics: Complex) -> Real:
        """Compute the gain at each angle, or an upper bound of it where that is below 1."""
        matrix, open_lines = self._loop(theta, passing, depth, orders, harmonics)
        if not len(open_lines):
            return np.zeros(len(theta))
        # the spectral norm is at most the root of the largest column sum times the largest row sum
        size = np.abs(matrix)
        gains = np.sqrt(size.sum(axis=1).max(axis=1) * size.sum(axis=2).max(axis=1))
        large = gains >= 1
        squared = matrix[large].conj().swapaxes(1, 2) @ matrix[large]
        gains[large] = np.sqrt(np.linalg.eigvalsh(squared)[:, -1]) if large.any() else 0.0
        return np.asarray(gains)

    def _loop(
        self, theta: Real, passing: float, depth: float, orders: Index, harmonics: Complex
    ) -> tuple[Complex, Index]:
        """Compute ``sqrt(r) M sqrt(r)`` at each angle, at the lines where r is not zero; return their orders, too."""
        lines = passing * (theta[:, None] / (2 * np.pi) + orders)
        receptance = self._receptance(lines.ravel())[:, self._motion][:, :, self._force]
        centre, radius = self.unmeasured.discs(lines.ravel())
        receptance = receptance + centre[:, None, None] * (self._motion[:, None] == self._force[None, :])
        n_motion, n_force = len(self._motion), len(self._force)
        size = len(orders) * n_motion
        regenerated = depth * (1 - np.exp(-1j * theta))[:, None, None]
        by_line = harmonics.reshape(len(orders), n_force, size)
        at_lines = receptance.reshape(len(theta), len(orders), n_motion, n_force)
        loop = regenerated * (at_lines @ by_line).reshape(len(theta), size, size)
        root = np.sqrt(radius).reshape(len(theta), len(orders))
        chosen = np.flatnonzero(root.any(axis=0))
        columns = (chosen[:, None] * n_motion + np.arange(n_motion)).ravel()
        rows = (chosen[:, None] * n_force + np.arange(n_force)).ravel()
        into, out = (np.repeat(root[:, chosen], count, axis=1) for count in (n_motion, n_force))
        moved = np.linalg.solve(np.eye(size) - loop, into[:, None, :] * np.eye(size)[:, columns])
        return np.asarray(out[:, :, None] * (regenerated * harmonics[rows]) @ moved), orders[chosen]


def with_band(
    structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes, max_depth: float
) -> StabilityLobes:
    """State for each limit whether it rests on measured dynamics.

    It does if its chatter frequency lies in the band, if unmeasured modes and cross terms leave the cut stable up to
    5 % below the limit (up to ``max_depth`` where there is none), and if they move the limit by at most 5 % to first
    order. With a helix, unequal pitch or process damping, they alone must be stable up to 20 times the limit.

    Parameters
    ----------
    structure, process
        Structure and cut of the limits; without a stated band the lobes are returned unchanged.
    lobes
        Limits of any solver.
    max_depth : m
        Largest depth that was searched.
    """
    unmeasured = unmeasured_dynamics(structure)
    if unmeasured is None:
        return lobes
    cut = RobustCut(structure, process, unmeasured)
    (low, high), chatter = unmeasured.band, lobes.chatter_frequencies
    depths = np.minimum(np.where(np.isfinite(chatter), 1 - SETTINGS.largest_shift, 1.0) * lobes.depth_limits, max_depth)
    if process.is_plain:
        good = _small_shifts(structure, process, lobes, unmeasured)
    elif process.is_helical:  # the gain below decides
        good = np.ones(len(depths), dtype=bool)
    else:
        good = depths <= SETTINGS.largest_shift * cut.least_depths(lobes.spindle_speeds)
    good &= np.isnan(chatter) | ((chatter >= low) & (chatter <= high))
    good &= np.isfinite(depths) & (depths < cut.highest_depth)
    for k in np.flatnonzero(good) if process.is_helical else ():
        good[k] = cut.gain(float(lobes.spindle_speeds[k]), float(depths[k])).gain < 1
    known = ~np.isnan(lobes.depth_limits)
    band = np.where(known, np.where(good, "measured", "unmeasured"), "not-stated")
    status = np.where(known & ~good, "unmeasured", lobes.numerics)
    return replace(lobes, status=tuple(status.tolist()), band=tuple(band.tolist()))


def _small_shifts(
    structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes, unmeasured: UnmeasuredDynamics
) -> NDArray[np.bool_]:
    """Check whether unmeasured modes shift each limit by at most 5 % to first order; true where there is no order."""
    small = np.ones(len(lobes.spindle_speeds), dtype=bool)
    for k, sensitivity in enumerate(limit_sensitivities(structure, process, lobes)):
        if sensitivity is not None:
            centre, radius = unmeasured.discs(sensitivity.lines)
            mean = np.einsum("qii,q->", sensitivity.weights, centre).real
            spread = np.linalg.norm(sensitivity.weights, axis=(1, 2)) @ radius
            small[k] = abs(mean) + spread <= SETTINGS.largest_shift * lobes.depth_limits[k]
    return small
