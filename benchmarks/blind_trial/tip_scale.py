"""Numbers of a joint inside, counted in the motion of the tip.

No channel shows the deflection x of such a joint. With ``x' = x / a`` and a law that is a times as strong, all that
is recorded stays the same. The tool says in which scale it counts, and the truth is counted in that scale here.
"""

from typing import Any

import numpy as np

from .structures import Structure, draw_structure

POWERS = {"half_gap": -1, "knee": -1, "v0": -1, "fc": 1, "stiffness_loss": 2, "stiffness_change": 2, "stiffness": 2}
POWERS |= {"k3": 4, "beta": 1, "gamma": 1}
"""Power of a in each number of a true law: lengths and speeds are a times as small, forces a times as large."""


def scale_at_tip(structure: Structure) -> float:
    """Length of d in ``x = d . y + rest``: the inner joint's deflection x regressed on the motion y of the tip.

    Forces on the tip are white and independent. The modal coordinates then have the covariance
    ``E q_r conj(q_s) = -(L L^H)_rs / (p_r + conj(p_s))``, which solves Lyapunov's equation for a diagonal system.

    Parameters
    ----------
    structure
        A structure with an inner joint.
    """
    assert structure.inner is not None
    poles = np.concatenate([structure.poles, structure.poles.conj()])
    left = np.vstack([structure.left, structure.left.conj()])
    right = np.vstack([structure.seen, structure.seen.conj()])
    covariance = -(left @ left.conj().T) / (poles[:, None] + poles.conj()[None, :])
    motion = (right.T @ covariance @ right.conj()).real
    return float(np.linalg.norm(np.linalg.solve(motion[:3, :3], motion[:3, 3])))


def counted_at_tip(spec: dict[str, Any], parameters: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """True numbers of a case whose joint sits inside, in the scale of the tip; of other cases as they are.

    Parameters
    ----------
    spec
        What decides the case.
    parameters
        True numbers of each change.
    """
    if spec.get("condition") != "inner_joint":
        return parameters
    # a case draws its structure first
    scale = scale_at_tip(draw_structure(np.random.default_rng(spec["seed"]), inner_joint=True))
    return [{name: value * scale ** POWERS.get(name, 0) for name, value in each.items()} for each in parameters]
