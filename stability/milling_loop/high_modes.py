"""High modes left as their static flexibility: what a robot's lobes cost with modes at kilohertz."""

from dataclasses import replace

import numpy as np

from modal_fit import ModalModel, Residuals


def with_static_high_modes(model: ModalModel, highest_frequency: float) -> ModalModel:
    """The model without the modes above a frequency, whose flexibility at 0 Hz stays.

    ``R = 2 Re sum_r right_r left_r^T / (-pole_r)`` over the modes left out. A limit at frequency f loses about
    ``(f / f_r)^2`` of what such a mode does; whether that matters shows in limits with more modes.

    Parameters
    ----------
    model
        Any modal model.
    highest_frequency : Hz
        Natural frequency up to which modes are kept; at least one is.

    Examples
    --------
    >>> poles = np.array([-2 + 100j, -20 + 9000j])
    >>> model = ModalModel(poles, np.array([[-1e-4j], [-1e-5j]]), np.ones((2, 1)) + 0j, ("T:+X",), ("T:+X",))
    >>> small = with_static_high_modes(model, 100.0)
    >>> len(small.poles), np.allclose(small.receptance(np.zeros(1)), model.receptance(np.zeros(1)))
    (1, True)
    """
    kept = model.natural_frequencies <= max(highest_frequency, float(model.natural_frequencies.min()))
    if kept.all():
        return model
    out = ~kept
    flexible = 2 * np.real(np.einsum("rp,rq->pq", model.right[out] / -model.poles[out, None], model.left[out]))
    known = model.residuals
    if known is None:
        residuals = Residuals(flexible, np.zeros_like(flexible))
    else:
        residuals = replace(known, upper=known.upper + flexible)
    return replace(model, poles=model.poles[kept], right=model.right[kept], left=model.left[kept], residuals=residuals)
