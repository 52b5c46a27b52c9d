"""Dry friction and hysteresis of one joint."""

from typing import Any

from benchmarks.blind_trial import laws

from ..integrator import Element
from .change import Change, Effect, Scene, fixed


def coulomb(scene: Scene, family: str, dial: float) -> Change:
    """Friction force ``dial F_rms``: regularised, with a Stribeck peak, or with a bristle (Dahl, LuGre)."""
    force = dial * scene.force
    rng = scene.rng()
    slow = scene.speed * rng.uniform(0.02, 0.08)
    bristle = scene.deflection * rng.uniform(0.03, 0.1)
    choices: dict[str, tuple[int, tuple[float, ...]]] = {
        "regularised": (laws.COULOMB, (force, slow)),
        "stribeck": (laws.STRIBECK, (force, slow, scene.speed * rng.uniform(0.2, 0.6))),
        "dahl": (laws.DAHL, (force, bristle)),
        "lugre": (laws.LUGRE, (force, bristle, 0.1 * force / scene.speed)),
    }
    code, parameters = choices[family]
    truth: dict[str, Any] = {"fc": force}
    if family == "regularised":
        truth["v0"] = slow
    if family == "stribeck":
        truth = {}
    return Change(joint=fixed(Element(code, parameters, scene.direction, scene.direction)), parameters=truth)


def hysteresis(scene: Scene, family: str, dial: float) -> Change:
    """Elastic-plastic element of stiffness ``dial k_static`` that yields within the deflection's range."""
    stiffness = dial * scene.stiffness
    rng = scene.rng()
    yields = scene.deflection * rng.uniform(0.25, 0.7)
    share = rng.uniform(0.5, 0.8)
    truth: dict[str, Any] = {}
    if family == "bouc_wen":
        code, parameters = laws.BOUC_WEN, (stiffness, share / yields, (1 - share) / yields)
        truth = {"stiffness": stiffness, "beta": parameters[1], "gamma": parameters[2]}
    elif family == "bouc_wen_square":
        code, parameters = laws.BOUC_WEN_SQUARE, (stiffness, share / yields**2, (1 - share) / yields**2)
    else:
        code, parameters = laws.IWAN, (stiffness, yields, 0.0)
    return Change(joint=fixed(Element(code, parameters, scene.direction, scene.direction)), parameters=truth)


EFFECTS = (
    Effect("coulomb_friction", ("regularised", "stribeck", "dahl", "lugre"), coulomb, 0.05, 5, True),
    Effect("hysteresis", ("bouc_wen", "bouc_wen_square", "iwan"), hysteresis, 0.1, 5, True),
)
