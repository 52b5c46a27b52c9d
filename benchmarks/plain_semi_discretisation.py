"""The baseline of ``lobe_speed.py``: first-order semi-discretisation in plain NumPy, as one would write it well.

One degree of freedom, uniform steps over the tooth period, coefficients averaged over each step, all depths of a speed
together in one batch, full eigenvalues of every monodromy matrix. Nothing of the package is used.
"""

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


def spectral_radii(
    natural: float,
    zeta: float,
    mass: float,
    cutting: tuple[float, float, int],
    immersion: tuple[float, float],
    speeds: Real,
    depths: Real,
    *,
    steps: int = 40,
) -> Real:
    """Spectral radius on a grid, (n_speeds, n_depths).

    Parameters
    ----------
    natural, zeta, mass
        rad/s, share of critical, kg.
    cutting
        Tangential and normal coefficient (N/m^2) and teeth.
    immersion
        Start and exit angle, rad.
    speeds : (n_speeds,), rad/s
        Spindle speeds of the grid.
    depths : (n_depths,), m
        Axial depths of the grid.
    steps
        In a tooth period.
    """
    tangential, normal, teeth = cutting
    share = (np.arange(steps)[:, None] + (np.arange(20) + 0.5) / 20) / steps
    average = np.zeros(steps)
    for tooth in range(teeth):
        phi = (share + tooth) * 2 * np.pi / teeth
        inside = (phi >= immersion[0]) & (phi < immersion[1])
        average += (inside * np.sin(phi) * (tangential * np.cos(phi) + normal * np.sin(phi))).mean(axis=1)
    radii = np.empty((len(speeds), len(depths)))
    for k, speed in enumerate(speeds):
        h = 2 * np.pi / teeth / speed / steps
        radii[k] = _radii(natural, zeta, mass, np.outer(depths, average), h)
    return radii


def _radii(natural: float, zeta: float, mass: float, stiffness: Real, h: float) -> Real:
    """``x'' + 2 zeta w x' + w^2 x = -(a k(t) / m) (x - x_tau)``; stiffness (n_depths, steps) is a k."""
    count, steps = stiffness.shape
    transition, start, rise = _step(natural, zeta, mass, stiffness, h)
    size = steps + 2
    monodromy = np.broadcast_to(np.eye(size), (count, size, size)).copy()
    state = np.zeros((count, 2, size))
    state[:, 0, 0], state[:, 1, 1] = 1.0, 1.0
    # the state holds (x, v) now and x at 1 ... steps steps ago
    old = np.zeros((size, size))
    old[0, 0] = 1.0
    history = [np.broadcast_to(np.eye(size)[0], (count, size))]
    for i in range(steps):
        late = np.eye(size)[steps - i + 1]  # x steps - i steps before the beginning, one period before step i
        later = np.eye(size)[steps - i] if steps - i > 1 else np.eye(size)[0]
        state = transition[:, i] @ state + start[:, i, :, None] * late + rise[:, i, :, None] * later
        history.append(state[:, 0])
    monodromy[:, :2] = state
    for j in range(steps):
        monodromy[:, 2 + j] = history[steps - 1 - j]
    return np.asarray(np.abs(np.linalg.eigvals(monodromy)).max(axis=1))


def _step(natural: float, zeta: float, mass: float, stiffness: Real, h: float) -> tuple[Real, Real, Real]:
    """Transition (n, steps, 2, 2) and weights (n, steps, 2) of the delayed positions at a step's ends, closed form."""
    square = natural**2 + stiffness / mass
    decay = zeta * natural
    damped = np.sqrt(square - decay**2 + 0j)
    cosine, sine = np.real(np.cos(damped * h)), np.real(np.sin(damped * h) / damped)
    ring = np.exp(-decay * h)
    transition = np.stack(
        [
            np.stack([ring * (cosine + decay * sine), ring * sine], axis=-1),
            np.stack([-ring * square * sine, ring * (cosine - decay * sine)], axis=-1),
        ],
        axis=-2,
    )
    push = stiffness / mass
    # particular solution for a push that goes from one value to another along the step
    constant = push / square
    slope = -2 * decay * push / square**2 / h
    zero = np.zeros_like(constant)
    at_start = np.stack([constant - slope * 0, zero], axis=-1)
    ramp_start = np.stack([slope, push / square / h], axis=-1)
    ramp_end = np.stack([push / square + slope, push / square / h], axis=-1)
    whole = at_start - (transition @ at_start[..., None])[..., 0]
    rise = ramp_end - (transition @ ramp_start[..., None])[..., 0]
    return transition, whole - rise, rise
