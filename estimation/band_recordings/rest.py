"""Whether a recording begins at rest: nothing moved before the first force, and all motion is of its own forces."""

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

QUIET_FORCE = 0.02
"""Share of its largest value up to which a force has not begun."""

QUIET_RESPONSE = 0.02
"""Power of a response before the first force, over its mean power, up to which the structure was at rest."""

QUIET_SAMPLES, QUIET_SECONDS = 16, 0.02
"""Least length of a quiet beginning: a motion that happens to pass zero is not quiet for so long."""

BLOW = 0.1
"""Share of the samples in which there is any force, up to which they are blows of a hammer."""

FIRST = 0.05
"""Largest response before a blow, over the largest of all, with which it hit a structure at rest; while the blow rises
its share of its largest value is added."""


def starts_at_rest(force: Real, response: Real, rate: float) -> bool:
    """Tell from the data whether a structure was at rest when a recording began.

    Either the recording begins quietly (pre-trigger): forces have not begun for a while, and what responds there has
    little of the power that it has later. Or it holds blows of a hammer, and before the first one, which may be at the
    very beginning, nothing had moved.

    Parameters
    ----------
    force : (n_samples, n_excitations)
        Samples of the forces, any offset included.
    response : (n_samples, n_responses)
        Samples of the responses, any offset included.
    rate
        Sample rate, Hz.

    Examples
    --------
    >>> blow = np.zeros((1000, 1)); blow[1] = 1.0
    >>> ring = np.exp(-np.arange(1000) / 100) * np.sin(0.3 * np.arange(1000))
    >>> starts_at_rest(blow, ring[:, None], 1000.0), starts_at_rest(blow, ring[5:, None], 1000.0)
    (True, False)
    """
    driven, moved = (np.abs(one - np.median(one, axis=0)) for one in (force, response))
    if not (driven.max(axis=0).any() and moved.any()):
        return False
    pushing = (driven > QUIET_FORCE * driven.max()).any(axis=1)
    first = int(np.argmax(pushing))
    if first >= max(QUIET_SAMPLES, QUIET_SECONDS * rate):
        before, whole = (np.mean(part**2, axis=0) for part in (moved[:first], moved))
        return bool((before <= QUIET_RESPONSE * whole).all())
    # an acceleration follows the blow at once, and only as far as the blow has risen
    risen = FIRST + driven[: first + 1].max(axis=1, keepdims=True) / driven.max()
    return bool(np.mean(pushing) < BLOW and (moved[: first + 1] <= risen * moved.max(axis=0)).all())
