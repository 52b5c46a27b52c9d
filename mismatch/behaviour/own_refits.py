"""What an answer leaves of each recording, beside what modes that are refitted to that recording alone leave."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from estimation import WindowedSpectrum
from foundation import MillfrfError

from ..inference import VerdictSettings
from ..models import ENOUGH, Hypothesis, shares_left
from .level_refit import refitted_modes

MOST_FITTED = 0.5
"""Share of the noise's power at most that a refit is taken to have fitted, however few its lines are."""


@dataclass(frozen=True)
class FollowedAlone:
    """A recording of which an answer leaves much that modes of its own follow: what is left there is no noise.

    Parameters
    ----------
    name
        Name of the recording.
    left
        Root mean square that the answer leaves, over the response.
    alone
        The same of modes that were refitted to the recording alone, with what they fit of the noise put back.
    """

    name: str
    left: float
    alone: float

    @property
    def sentence(self) -> str:
        """What a reader is told."""
        return (
            f"the answer leaves {100 * self.left:.3g} % of {self.name}, and modes that are refitted to it alone leave "
            f"{100 * self.alone:.3g} %: what is left there is no noise, so the answer is not whole"
        )


def followed_alone(
    answer: Hypothesis, base: Hypothesis, recordings: Sequence[WindowedSpectrum], settings: VerdictSettings
) -> tuple[FollowedAlone, ...]:
    """Recordings of which an answer leaves far more than modes that are refitted to each alone.

    Noise that is inferred from what an answer leaves would hold all of it. What a linear model of one recording
    follows is no noise of that recording. With n_p numbers, the refit follows the share ``n_p / (2 n_lines n_r)`` of
    the power of white noise as well, which is put back.

    Parameters
    ----------
    answer
        The hypothesis that would be told.
    base
        Modal parameters alone, fitted to all recordings: where the refits begin.
    recordings
        Recordings without tones and with clipped samples put back.
    settings
        Thresholds of the verdict.
    """
    found = []
    for one in recordings:
        left = float(np.sqrt(np.mean(shares_left(answer, one))))
        if left <= settings.most_not_noise:
            continue
        alone = _left_alone(base, one)
        apart = np.sqrt(max(left**2 - alone**2, 0.0))
        if left > settings.most_over_alone * alone and apart > settings.most_not_noise:
            found.append(FollowedAlone(one.recording.name, left, alone))
    return tuple(found)


def _left_alone(base: Hypothesis, lines: WindowedSpectrum) -> float:
    """Root mean square that modes of the recording's own leave, over the response; infinite where no refit is found."""
    try:
        misfit = refitted_modes(base, lines).misfit
    except (MillfrfError, ValueError, ArithmeticError, np.linalg.LinAlgError):
        return np.inf
    numbers = 2 * min(len(lines.frequencies), ENOUGH) * lines.measured.shape[1]
    return misfit / float(np.sqrt(1 - min(base.shape.modal_size / numbers, MOST_FITTED)))
