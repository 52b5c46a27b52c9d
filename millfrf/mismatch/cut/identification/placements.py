"""Which way the force sensors point, and how many teeth cut: every possibility is tried."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
import scipy

from millfrf.core import InputError

from .coefficient_fit import CoefficientFit, fit_cuts, fit_mean_forces, grid_misfit
from .cut_forces import CutForces

TEETH = (1, 2, 3, 4, 5, 6, 8)  # numbers of teeth that are tried
EXPLAINED = 0.1  # largest misfit of waveforms whose coefficients are used: what the model lacks biases them as much
CHANCE = 1e-3  # probability below which another placement's smaller misfit is no chance


@dataclass(frozen=True)
class Placement:
    """Which measured force, and with which sign, acts along each axis of the cut.

    Parameters
    ----------
    order
        Number of the measured force along each measured axis of the cut.
    signs
        Its sign, 1 or -1.
    """

    order: tuple[int, ...]
    signs: tuple[int, ...]

    @property
    def as_stated(self) -> bool:
        """Whether nothing is exchanged or turned."""
        return self.order == tuple(range(len(self.order))) and min(self.signs) > 0

    def of(self, cut: CutForces) -> CutForces:
        """Return the forces of a cut in this placement."""
        order, signs = list(self.order), np.array(self.signs)
        transfer = cut.transfer
        if transfer is not None:
            transfer = transfer[:, order][:, :, order] * np.outer(signs, signs)
        return replace(
            cut,
            mean=cut.mean[:, order] * signs,
            error=cut.error[:, order],
            drift=cut.drift[order],
            transfer=transfer,
        )

    def after(self, earlier: "Placement") -> "Placement":
        """Return this placement of forces that an earlier one has placed already.

        Examples
        --------
        >>> Placement((1, 0), (1, -1)).after(Placement((1, 0), (-1, 1)))
        Placement(order=(0, 1), signs=(1, 1))
        """
        return Placement(
            tuple(earlier.order[k] for k in self.order),
            tuple(sign * earlier.signs[k] for k, sign in zip(self.order, self.signs, strict=True)),
        )

    def words(self, axes: Sequence[int]) -> tuple[str, ...]:
        """Return the placement as typed: the measured direction that acts along each axis of the cut.

        Examples
        --------
        >>> Placement((1, 0, 2), (1, 1, -1)).words((0, 1, 2))
        ('+Y', '+X', '-Z')
        """
        return tuple("+-"[sign < 0] + "XYZ"[axes[k]] for k, sign in zip(self.order, self.signs, strict=True))


def parsed_placement(words: Sequence[str], axes: Sequence[int]) -> Placement:
    """Return the placement of words such as ``+Y, +X, -Z``, one for each measured axis of the cut.

    Raises
    ------
    InputError
        A word that names no measured direction, or one that is named twice.
    """
    names = ["XYZ"[axis] for axis in axes]
    words = [words[axis] for axis in axes] if len(words) > len(axes) else words  # no force along Z was measured
    if sorted(word.strip("+-") for word in words) != sorted(names):
        raise InputError(
            f"axes {','.join(words)}: name each measured direction ({', '.join(names)}) once, with its sign, for "
            f"example {','.join('+' + name for name in names)}"
        )
    return Placement(
        tuple(names.index(word.strip("+-")) for word in words), tuple(-1 if word[0] == "-" else 1 for word in words)
    )


def is_possible(cuts: Sequence[CutForces]) -> bool:
    """Return whether the mean forces give coefficients that a tool can have.

    A tool pushes the chip along its path (``Ktc > 0``) and is pushed away from the surface (``Krc > 0``) with less
    force than along it. Along the axis chip and edge pull the same way, with a helix out of the spindle (``Kac > 0``).
    A coefficient counts as wrong if it is so by more than two standard errors.
    """
    coefficients, covariance = fit_mean_forces(cuts)
    tangential, radial, axial = coefficients[:3]
    errors = 2 * np.sqrt(np.diag(covariance))
    pushed = bool(axial < -errors[2])  # False where no force along Z was measured
    pushed &= min(cut.process.helix_angle for cut in cuts) > 0 or bool(coefficients[5] < -errors[5])
    return bool(
        tangential > -errors[0]
        and radial > -errors[1]
        and radial - tangential < np.hypot(errors[0], errors[1])
        and not pushed
    )


def _is_pushed(cuts: Sequence[CutForces], fit: CoefficientFit) -> bool:
    """Return whether the waveforms show a helix that pushes the tool into the spindle, ``Kac < 0`` by two errors."""
    axial, variance = fit.coefficients[2], fit.covariance[2, 2]
    helix = min(cut.process.helix_angle for cut in cuts) > 0
    return bool(helix and fit.misfit <= EXPLAINED and axial < -2 * np.sqrt(variance))


def require_placement(
    cuts: Sequence[CutForces], fit: CoefficientFit, stated: Placement, channels: Sequence[str]
) -> None:
    """Refuse forces that fit the cut in another placement only.

    Parameters
    ----------
    cuts
        Forces as stated.
    fit
        Their fit.
    stated
        How the measured forces were placed.
    channels
        Names of the forces, for the message.

    Raises
    ------
    InputError
        The stated directions give coefficients that no tool has, or another placement leaves a smaller misfit by more
        than chance (F-test).
    """
    axes = cuts[0].axes
    # means whose zero drifts may leave the sign of the axial force open, which the waveforms show
    stated_possible = is_possible(cuts) and not _is_pushed(cuts, fit)
    ranked = sorted(_others(cuts), key=lambda entry: entry[0])
    if not ranked:
        if not stated_possible:
            raise InputError(
                f"no assignment of {', '.join(channels)} to the axes of the cut gives a positive tangential force that "
                "grows with the feed; check the feeds, the engagement and the zero of the sensors"
            )
        return
    _, placement = ranked[0]
    other = fit_cuts([placement.of(cut) for cut in cuts])
    if _is_pushed(cuts, other):
        placement = replace(placement, signs=(*placement.signs[:2], -placement.signs[2]))
        other = fit_cuts([placement.of(cut) for cut in cuts])
    ratio = fit.residual_power / max(other.residual_power, 1e-300)
    smaller = scipy.stats.f.sf(ratio, fit.freedom, other.freedom) < CHANCE
    if stated_possible and not smaller:
        return
    impossible = "" if stated_possible else ", coefficients that no tool has"
    option = f"--axes={','.join(placement.after(stated).words(axes))}"
    raise InputError(
        f"the forces {', '.join(channels)} do not act along {', '.join('XYZ'[a] for a in axes)} of the cut as stated "
        f"(misfit {100 * fit.misfit:.0f} %{impossible}): with {option} the misfit "
        f"is {100 * other.misfit:.0f} %; add this option, or correct the directions of the channels"
    )


def _others(cuts: Sequence[CutForces]) -> list[tuple[float, Placement]]:
    """Return the possible placements other than the stated one, each with the misfit of a rough fit."""
    axes = cuts[0].axes
    others = []
    for order, signs in product(permutations(range(len(axes))), product((1, -1), repeat=len(axes))):
        placement = Placement(order, signs)
        if placement.as_stated:
            continue
        placed = [placement.of(cut) for cut in cuts]
        if is_possible(placed):
            others.append((grid_misfit(placed), placement))
    return others


def other_teeth(cuts: Sequence[CutForces], fit: CoefficientFit) -> int | None:
    """Return the number of teeth with which the forces fit clearly better than with the stated one; None without one.

    The feed per revolution is kept. The orders that ``teeth`` equal teeth cannot make are the evidence: runout alone
    makes them where they are.
    """
    stated = cuts[0].process.teeth
    if cuts[0].process.pitch_angles:
        return None
    misfits = {teeth: grid_misfit([_with_teeth(cut, teeth) for cut in cuts]) for teeth in TEETH if teeth != stated}
    teeth = min(misfits, key=lambda count: misfits[count])
    if misfits[teeth] >= grid_misfit(cuts):
        return None
    other = fit_cuts([_with_teeth(cut, teeth) for cut in cuts])
    ratio = fit.residual_power / max(other.residual_power, 1e-300)
    return teeth if scipy.stats.f.sf(ratio, fit.freedom, other.freedom) < CHANCE else None


def _with_teeth(cut: CutForces, teeth: int) -> CutForces:
    feed = cut.process.feed_per_tooth * cut.process.teeth / teeth
    return replace(cut, process=replace(cut.process, teeth=teeth, feed_per_tooth=feed))
