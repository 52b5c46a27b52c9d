"""What faults of a recording do to a predicted response: a tone is in it, a channel saturates."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft

from estimation import BandRecording, WindowedSpectrum

from ..inference import AcceptedCause
from ..models import Hypothesis, predict_lines
from ..physics import FaultPhysics, library

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def with_faults(response: Real, recording: BandRecording, start: int, terms: Sequence[Mapping[str, Any]]) -> Real:
    """A predicted response with the faults of a recording: tones first, then limits.

    Parameters
    ----------
    response : (n_samples, n_responses)
        Predicted response without faults.
    recording
        The recording that has the faults.
    start
        First sample after the run-in.
    terms
        Causes as ``{name, location, parameters}``; those that are no faults are passed over.
    """
    known = library()
    faults = [(physics, term) for term in terms if isinstance(physics := known.get(term["name"]), FaultPhysics)]
    for physics, term in sorted(faults, key=lambda pair: pair[0].order):
        response = physics.shown(response, recording, start, term)
    return response


def residual_lines(hypothesis: Hypothesis, lines: WindowedSpectrum, faults: Sequence[AcceptedCause] = ()) -> Complex:
    """What a hypothesis, with the faults of a recording, leaves of it, (n_lines, n_responses).

    Parameters
    ----------
    hypothesis
        Hypothesis that predicts the response.
    lines
        Windowed lines of the recording.
    faults
        Tones and limits of the recording, which are put into the prediction.
    """
    predicted = predict_lines(hypothesis, lines)
    if not faults:
        return lines.measured - predicted.response
    signal = np.asarray(irfft(predicted.spectrum, n=lines.padded, axis=0)[: len(lines.recording.force)])
    return lines.measured - lines.cut(
        with_faults(signal, lines.recording, lines.start, [asdict(one) for one in faults])
    )
