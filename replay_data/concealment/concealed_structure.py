"""Effects on the structure itself: other modes, a joint's law, a force that nobody measures."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from ..simulation import LINEAR, JointLaw
from .concealed_effect import JOINT_EFFECTS, ConcealedEffect
from .random_posture import real_modes


def concealed_structure(structure: ModalModel, effect: ConcealedEffect) -> ModalModel:
    """The structure that is milled, of which the taps knew only ``structure`` (real modes)."""
    natural, zeta, shapes = 2 * np.pi * structure.natural_frequencies, structure.damping_ratios, structure.left.real
    values = effect.parameters
    if effect.name == "modal_parameters":
        factors = (np.array(values[name]) for name in ("frequency_factors", "damping_factors"))
        return real_modes(natural * next(factors), zeta * next(factors), shapes)
    if effect.name == "missing_mode":
        more = (2 * np.pi * values["frequency_hz"], values["damping_ratio"], values["shape"])
        return real_modes(np.append(natural, more[0]), np.append(zeta, more[1]), np.vstack([shapes, more[2]]))
    return structure


def concealed_law(effect: ConcealedEffect) -> JointLaw:
    """The law that acts on the tip while milling; that of nothing for effects elsewhere."""
    if effect.name == "gyroscopic_coupling":
        x, y, z = effect.parameters["coupling_ns_per_m"]
        return LINEAR._replace(coupling=np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))
    if effect.name not in JOINT_EFFECTS or effect.direction is None:
        return LINEAR
    values = np.zeros(3)
    values[: len(effect.parameters)] = list(effect.parameters.values())
    return LINEAR._replace(name=effect.name, direction=np.array(effect.direction), parameters=values)


def unmeasured_force(effect: ConcealedEffect, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force (n, 3) that shakes the tip and passes no dynamometer, N, at ``times`` (s)."""
    if effect.name != "unmeasured_excitation":
        return np.zeros((len(times), 3))
    values: dict[str, Any] = effect.parameters
    return np.asarray(np.sin(2 * np.pi * values["frequency_hz"] * times)[:, None] * np.array(values["force_n"]))
