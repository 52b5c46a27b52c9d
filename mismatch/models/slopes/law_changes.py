"""What the numbers of a joint's law change of its force."""

import numpy as np
from numpy.typing import NDArray

from estimation import WindowedSpectrum

from ...joints import JointLaw, JointResponse, LawSlopes, law_change_run, law_quotient, law_slopes
from ...physics import FreeForm
from ..cause import Cause

Signals = NDArray[np.float32]


def cause_slopes(cause: Cause) -> LawSlopes:
    """Derivative of a joint's law by the coordinates of its numbers.

    Parameters
    ----------
    cause
        A joint's cause. The factors of a free form are taken as they are, all other numbers by difference quotients.
    """
    law, here, steps = cause.law(), cause.coordinates(), cause.steps_aside()
    linear: tuple[JointLaw, ...] = ()
    if isinstance(cause.physics, FreeForm) and cause.motion is not None:
        linear = cause.physics.law_changes(cause.values, cause.motion)
    quotients = []
    for k in range(len(cause.values) - len(linear)):
        aside = here.copy()
        aside[k] += steps[k]
        quotients.append(law_quotient(law, cause.moved(aside).law(), steps[k]))
    return law_slopes(law, [*quotients, *linear])


def given_motion_change(cause: Cause, lines: WindowedSpectrum, answer: JointResponse) -> Signals:
    """Derivative of a joint's force by its law's numbers at the motion seen, (n, n_numbers), N by a coordinate.

    Parameters
    ----------
    cause
        A joint whose law is driven by what was seen.
    lines
        Windowed spectrum of the recording.
    answer
        The joint's motion at the recording's samples.
    """
    law, n = cause.law(), len(lines.recording.force)
    out, sticks = np.empty((n, len(cause.values)), dtype=np.float32), np.empty((n, len(law.yields)), dtype=np.bool_)
    law_change_run(
        (answer.deflection[:n], answer.velocity[:n]),
        0,
        ((law.reach, law.speed), law.yields),
        (*cause_slopes(cause).parts, 1 / (lines.recording.rate * lines.recording.duration)),
        (np.zeros(len(law.yields)), np.zeros(len(law.yields))),
        (sticks, out),
    )
    return out
