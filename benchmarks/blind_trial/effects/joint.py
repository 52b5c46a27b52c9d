"""Elastic effects of one joint: hardening, softening, backlash, drift, and gyroscopic coupling of two."""

from functools import partial

import numpy as np

from benchmarks.blind_trial import laws

from ..excitation import BEFORE, DURATION, RATE, Test
from ..integrator import Element
from .change import Change, Effect, Scene, fixed

_HARDENING = {"cubic": laws.CUBIC, "power_2.5": laws.POWER, "saturating": laws.SATURATING, "bumper": laws.BUMPER}
_SOFTENING = {"saturating": laws.SATURATING, "rational": laws.RATIONAL, "root": laws.ROOT}
_GAP = {"sharp": laws.GAP_SHARP, "smooth": laws.GAP_SMOOTH}


def _along(scene: Scene, code: int, *parameters: float) -> Change:
    return Change(joint=fixed(Element(code, parameters, scene.direction, scene.direction)))


def hardening(scene: Scene, family: str, dial: float) -> Change:
    """Restoring force that grows faster than the deflection (laws CUBIC, POWER, SATURATING, BUMPER)."""
    amplitude = dial * scene.force
    if family == "cubic":
        cubic = amplitude / scene.deflection**3
        element = Element(laws.CUBIC, (amplitude, scene.deflection), scene.direction, scene.direction)
        return Change(joint=fixed(element), parameters={"k3": cubic})
    knee = scene.deflection * scene.rng().uniform(0.6, 1.2)
    if family == "power_2.5":
        return _along(scene, laws.POWER, amplitude, knee)
    return _along(scene, _HARDENING[family], 3 * amplitude / scene.deflection, knee)


def softening(scene: Scene, family: str, dial: float) -> Change:
    """Stiffness ``dial k_static`` is lost where the deflection exceeds a knee."""
    knee = scene.deflection * scene.rng().uniform(0.4, 1.0)
    loss = dial * scene.stiffness
    parameters = {"stiffness_loss": loss, "knee": knee} if family == "saturating" else {}
    element = Element(_SOFTENING[family], (-loss, knee), scene.direction, scene.direction)
    return Change(joint=fixed(element), parameters=parameters)


def backlash(scene: Scene, family: str, dial: float) -> Change:
    """Stiffness ``dial k_static`` is missing inside a gap and whole outside of it."""
    gap = scene.deflection * scene.rng().uniform(0.3, 0.8)
    loss = dial * scene.stiffness
    element = Element(_GAP[family], (-loss, gap), scene.direction, scene.direction)
    return Change(joint=fixed(element), parameters={"stiffness_loss": loss, "half_gap": gap})


def drift(scene: Scene, family: str, dial: float) -> Change:
    """Stiffness along the joint changes by ``dial k_static`` in each cut: linearly, or as ``1 - exp(-t/tau)``."""
    sign = -1.0 if scene.rng().random() < 0.6 else 1.0
    change = sign * dial * scene.stiffness

    def elements(test: Test) -> tuple[Element, ...]:
        share = np.clip((np.arange(len(test.force)) / RATE - BEFORE) / DURATION, 0, 1)
        if family == "exponential":
            share = (1 - np.exp(-share / 0.4)) / (1 - np.exp(-1 / 0.4))
        return (Element(laws.SCHEDULED, (change,), scene.direction, scene.direction, share),)

    return Change(joint=elements, parameters={"stiffness_change": change})


def gyroscopic(scene: Scene, family: str, dial: float) -> Change:
    """``F = -c (d1 d2^T - d2 d1^T) x'``: a rotor couples two coordinates with opposite signs (Genta, Dynamics of
    Rotating Systems, 2005, section 2.4)."""
    coupling = dial * scene.force / scene.speed
    there = Element(laws.VISCOUS, (coupling,), scene.other, scene.direction)
    back = Element(laws.VISCOUS, (-coupling,), scene.direction, scene.other)
    return Change(joint=fixed(there, back), parameters={"c_g": coupling})


def parametric(scene: Scene, family: str, dial: float) -> Change:
    """Foreign: stiffness modulated by the spindle's angle, ``k cos(m theta) u``."""
    order = {"once": 1, "twice": 2}[family]

    def elements(test: Test) -> tuple[Element, ...]:
        schedule = np.cos(order * test.angle)
        return (Element(laws.SCHEDULED, (dial * scene.stiffness,), scene.direction, scene.direction, schedule),)

    return Change(joint=elements)


def speed_law(code: int, scene: Scene, family: str, dial: float) -> Change:
    """Foreign: damping that is neither dry nor viscous."""
    return _along(scene, code, dial * scene.force, scene.speed)


EFFECTS = (
    Effect("stiffness_hardening", tuple(_HARDENING), hardening, 0.1, 30, True),
    Effect("stiffness_softening", tuple(_SOFTENING), softening, 0.1, 0.7, True),
    Effect("backlash", tuple(_GAP), backlash, 0.1, 0.85, True),
    Effect("pose_drift", ("linear", "exponential"), drift, 0.05, 0.6, True),
    Effect("gyroscopic_coupling", ("rotor",), gyroscopic, 0.05, 5),
)
FOREIGN = (
    Effect("parametric_stiffness", ("once", "twice"), parametric, 0.1, 0.7),
    Effect("root_speed_damping", ("root",), partial(speed_law, laws.ROOT_SPEED), 0.05, 10),
    Effect(
        "square_speed_damping", ("square",), partial(speed_law, laws.SQUARE_SPEED), 0.05, 10, answer="quadratic_damping"
    ),
)
