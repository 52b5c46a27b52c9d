"""What a further cause would gain while the forms of the laws before it are free: what their forms may mend is not its.

The form of a joint's law is never quite the true one. What that leaves may look like a delay, a mode, or another law.
Shapes of the law's own family are therefore fitted beside the further cause, all to first order (Rao's score test with
nuisance numbers): a cause of its own keeps most of its gain, one that mends a form loses it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from estimation import WindowedSpectrum

from ...models import EVERYTHING, Cause, Fit, with_free_forms
from ...physics import ChainPhysics, JointPhysics, ModePhysics
from ..chain_screening import gain_of_chain
from ..joint_screening import screen_joints
from ..missing_mode import find_mode
from ..whitened_residual import Floor, noise_floor


@dataclass(frozen=True)
class Gains:
    """What a further cause would gain in misfit.

    Parameters
    ----------
    held
        Beside the laws as they are.
    free
        Beside the same laws in any form.
    """

    held: float
    free: float

    def own(self, needed: float, kept: float) -> bool:
        """Whether a cause gains enough beside laws of any form, and keeps enough of what it gains beside these.

        Parameters
        ----------
        needed
            Gain that is enough.
        kept
            Share that is enough of the gain beside the laws as they are.

        Examples
        --------
        >>> Gains(5000.0, 2900.0).own(1200.0, 0.33), Gains(5000.0, 1300.0).own(1200.0, 0.33)
        (True, False)
        """
        return self.free >= max(needed, kept * self.held)


def gains_beside_laws(lines: list[WindowedSpectrum], current: Fit, causes: Sequence[Cause]) -> list[Gains]:
    """Gain of one more cause beside laws as they are, and in any form, for each of several causes.

    Laws may be mended by all shapes where the cause is linear. Where it is a law itself, they may be mended by shapes
    of their own family alone: what a spring explains beside friction in any form is no friction.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    current
        A fit with at least one law of a joint, without the causes.
    causes
        Further causes, each on its own.
    """
    if not causes:
        return []
    kinds = ["" if isinstance(one.physics, JointPhysics) else EVERYTHING for one in causes]
    held = noise_floor(current, lines)
    free = {kind: replace(current, hypothesis=with_free_forms(current.hypothesis, kind)) for kind in kinds}
    floors = {kind: noise_floor(one, lines) for kind, one in free.items()}
    return [
        Gains(_gain(held, current, one), _gain(floors[kind], free[kind], one))
        for one, kind in zip(causes, kinds, strict=True)
    ]


def _gain(floor: Floor, fitted: Fit, cause: Cause) -> float:
    """Gain of a cause in misfit, everything that is fitted adapting."""
    physics = cause.physics
    if isinstance(physics, ChainPhysics):
        absent = Cause(physics, physics.start(fitted.hypothesis.shape.nominal), cause.place)
        return gain_of_chain(floor, fitted.hypothesis, absent)
    if isinstance(physics, ModePhysics):
        return find_mode(floor, fitted.hypothesis, physics).gain
    assert isinstance(physics, JointPhysics)
    assert cause.axis is not None
    screened = screen_joints(floor, fitted.hypothesis, cause.axis, [physics])
    return screened[0].gain if screened else 0.0
