"""A posture to begin with: the tool down, far from limits and singularities."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from foundation import InputError

from ..kinematics import Mechanism, reach, tool_jacobian

Real = NDArray[np.float64]


def ready_posture(mechanism: Mechanism, tries: int = 400) -> tuple[Real, bool]:
    """Look for a well-conditioned posture with a vertical tool.

    Of a Halton sequence over the inner four fifths of the joints' ranges, the posture with the largest smallest
    singular value of the tool's Jacobian (m, rad) whose tool points most nearly downwards is turned upright.

    Returns
    -------
    (n_moving,), rad and m, and whether the tool is vertical there
    """
    frames = [mechanism.frames[index] for index in mechanism.moving]
    half = np.array([1.0 if frame.motion == "prismatic" else 2.0 for frame in frames])
    lower = np.maximum([frame.lower for frame in frames], -half)
    upper = np.minimum([frame.upper for frame in frames], half)
    empty = lower >= upper  # a range that does not hold zero
    lower = np.where(empty, [frame.lower for frame in frames], lower)
    upper = np.where(empty, [frame.upper for frame in frames], upper)
    middle, width = (lower + upper) / 2, 0.8 * (upper - lower)
    samples = middle + width * (qmc.Halton(len(frames), scramble=False).random(tries + 1)[1:] - 0.5)
    turning = [place for place, frame in enumerate(frames) if frame.motion == "revolute"]
    samples[:, turning[:1]] = np.clip(0.0, lower, upper)[turning[:1]]  # turning about the base changes nothing
    tool = mechanism.index(mechanism.tool)
    scores = []
    for q in samples:
        placed = mechanism.transforms(q)[tool]
        smallest = float(np.linalg.svd(tool_jacobian(mechanism, q), compute_uv=False)[-1])
        scores.append(smallest * (1.5 - placed[2, 2]))
    order = np.argsort(scores)[::-1]
    for chosen in order[:8]:
        q = samples[chosen]
        target = mechanism.transforms(q)[tool].copy()
        heading = float(np.arctan2(target[1, 0], target[0, 0]))
        cosine, sine = np.cos(heading), np.sin(heading)
        target[:3, :3] = [[cosine, sine, 0.0], [sine, -cosine, 0.0], [0.0, 0.0, -1.0]]
        try:
            return reach(mechanism, target, q, starts=4), True
        except InputError:
            continue
    return samples[order[0]], False
