"""A response channel that cannot show more than a limit."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import BandRecording

from ..joints import saturated
from .protocol import Parameter

Real = NDArray[np.float64]


class Clipping:
    """An amplifier or a converter that is driven beyond its range, sharply or rounding off before its limit."""

    order = 1
    name = "clipping"
    equation = "y_shown = y / (1 + |y / l|^n)^(1/n), sharp for n = infinity"
    source = "Godsill & Rayner, Digital Audio Restoration, 1998, section 4.1"
    parameters: tuple[Parameter, ...] = (Parameter("limit", "unit of the channel", 0.01, 0.0),)
    confusable_with = ("stiffness_hardening",)

    def shown(self, response: Real, recording: BandRecording, start: int, term: Mapping[str, Any]) -> Real:
        """Return a predicted response (n_samples, n_responses) whose clipped channel is held below the limit."""
        response = response.copy()
        column = recording.channels.index(term["location"]["channel"]) - recording.force.shape[1]
        limit, sharpness = (float(term["parameters"].get(name, np.inf)) for name in ("limit", "sharpness"))
        response[:, column] = saturated(response[:, column], limit, sharpness)
        return response


PHYSICS = Clipping()
