"""From a `CaseSpec` to what a lab would have: the nominal model, recordings, and the truth."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .case_spec import CaseSpec
from .effects import ALL, FOREIGN, Change, Effect, Scene
from .excitation import KEPT, LEVELS, Test, milling_test
from .integrator import linear_response, respond, tip_motion
from .noise import measurement_noise
from .refit import after_refit
from .structures import LabError, Structure, draw_structure, nominal_model

SMALL_MODES = 0.3
"""Response of the small unmodelled modes of a control, in units of noise."""


@dataclass(frozen=True)
class Case:
    """Nominal model, recordings by level (n_samples, 6), node of the accelerometers, and the truth."""

    nominal: ModalModel
    recordings: dict[str, NDArray[np.float64]]
    node: str
    truth: dict[str, Any]


@dataclass(frozen=True)
class Bench:
    """The structure, its tests, and the seed of what each recording draws."""

    structure: Structure
    tests: dict[str, Test]
    seed: int

    def observed(self, level: str, changes: list[Change], factor: int) -> tuple[NDArray[np.float64], ...]:
        """Measured forces and accelerations without noise, each (n, 3) with run-in and run-out."""
        test = self.tests[level]
        rng = np.random.default_rng([self.seed, list(LEVELS).index(level)])
        grown = next((c.structure for c in changes if c.structure is not None), self.structure)
        elements = [element for c in changes if c.joint is not None for element in c.joint(test)]
        pushed = test.force + sum(
            (c.shake(len(test.force), rng) for c in changes if c.shake is not None), np.zeros_like(test.force)
        )
        motion = respond(grown, pushed, elements, factor) if elements else linear_response(grown, pushed)
        forces = test.force
        for change in changes:
            forces = change.force_chain(forces, rng) if change.force_chain is not None else forces
            motion = change.acceleration_chain(motion, rng) if change.acceleration_chain is not None else motion
        return forces, motion

    def residual(self, level: str, changes: list[Change], factor: int = 4) -> NDArray[np.float64]:
        """RMS per channel of what the linear structure leaves of noise-free accelerations, and their own: (2, 3)."""
        forces, motion = self.observed(level, changes, factor)
        motion = _converted(motion, changes, np.random.default_rng(self.seed))
        left = motion - linear_response(self.structure, forces)
        return np.stack([left[KEPT].std(axis=0), motion[KEPT].std(axis=0)])


def _converted(motion: NDArray[np.float64], changes: list[Change], rng: np.random.Generator) -> NDArray[np.float64]:
    for change in changes:
        motion = change.after_noise(motion, rng) if change.after_noise is not None else motion
    return motion


def over_noise(residual: NDArray[np.float64], noise: float) -> float:
    """Ratio of residual to noise: root of the mean over channels of the squared ratios."""
    return float(np.sqrt(np.mean((residual[0] / (noise * residual[1])) ** 2)))


def find_dial(bench: Bench, scene: Scene, effect: Effect, family: str, strength: float, noise: float) -> float:
    """Dial at which the effect has the wanted strength within 10 %, or the nearest: bracketed secants in logarithms."""
    dial, slope = effect.start, 1.0
    tried: list[tuple[float, float]] = []
    for _ in range(9):
        ratio = max(over_noise(bench.residual("mid", [effect.build(scene, family, dial)]), noise), 1e-6)
        ratio = ratio if np.isfinite(ratio) else 1e6
        tried.append((dial, ratio))
        miss = np.log(strength / ratio)
        if abs(miss) < 0.1 or (dial >= effect.largest and miss > 0):
            break
        if len(tried) > 1 and tried[-2][0] != dial:
            run = np.log(dial / tried[-2][0])
            slope = float(np.clip(np.log(ratio / tried[-2][1]) / run, 0.3, 12.0))
        low = max((d for d, r in tried if r < strength), default=0.0)
        high = min((d for d, r in tried if r >= strength), default=np.inf)
        dial = float(min(dial * np.exp(np.clip(miss / slope, -3, 3)), effect.largest))
        if 0 < low < high < np.inf:
            dial = float(np.clip(dial, low**0.8 * high**0.2, low**0.2 * high**0.8))
    return min(tried, key=lambda pair: abs(float(np.log(strength / pair[1]))))[0]


def build_case(spec: CaseSpec) -> Case:
    """Simulate one case; the same spec gives the same case to the last bit on the same machine."""
    rng = np.random.default_rng(spec.seed)
    away = spec.condition == "sensor_away"
    structure = draw_structure(rng, away, spec.condition == "inner_joint")
    scale = float(rng.uniform(25, 60))
    plan, other = int(rng.integers(1 << 31)), int(rng.integers(1 << 31))
    tests = {
        level: milling_test(spec.excitation, level, scale, other if level == "unseen" else plan, rng)
        for level in LEVELS
    }
    bench = Bench(structure, tests, spec.seed)
    inside = spec.condition == "inner_joint"
    scene = _scene(bench, np.array([0.0, 0, 0, 1]) if inside else _direction(spec.joint, rng), rng)
    changes = _changes(spec, bench, scene)
    sensor = str(rng.choice(["head", "head_and_tip"])) if away else "tip"
    nominal = nominal_model(structure, rng, _lab_error(spec), sensor)
    recordings, facts = {}, {}
    for level in LEVELS:
        recordings[level], facts[level] = _record(spec, bench, changes, nominal, level)
    truth = _truth(spec, scene, changes, facts)
    if spec.condition == "level_missing":
        truth["missing_level"] = str(rng.choice(["low", "mid", "high"]))
        recordings.pop(truth["missing_level"])
    if spec.condition == "channel_missing":
        truth["missing_channel"] = str(rng.choice(["ax", "ay", "az"]))
    return Case(nominal, recordings, "HEAD" if away else "TCP", truth)


def _direction(joint: int, rng: np.random.Generator) -> NDArray[np.float64]:
    """Random unit vector whose largest component is that of axis ``joint``, at least 12 degrees off it."""
    while True:
        drawn = rng.standard_normal(3)
        drawn /= np.linalg.norm(drawn)
        if np.abs(drawn).argmax() == joint and np.abs(drawn).max() < np.cos(np.radians(12)):
            return np.asarray(drawn)


def _scene(bench: Bench, direction: NDArray[np.float64], rng: np.random.Generator) -> Scene:
    force = bench.tests["mid"].force
    deflection, speed = tip_motion(bench.structure, force, direction)
    other = np.cross(direction[:3], rng.standard_normal(3)) if direction[:3].any() else np.array([1.0, 0, 0])
    return Scene(
        bench.structure,
        direction,
        other / np.linalg.norm(other),
        float(np.sqrt(np.mean(deflection[KEPT] ** 2))),
        float(speed[KEPT].std()),
        abs(bench.structure.static_stiffness(direction)),
        float(np.sqrt(np.mean(force[KEPT] ** 2))),
        linear_response(bench.structure, force)[KEPT].std(axis=0),
        int(rng.integers(1 << 31)),
    )


def _changes(spec: CaseSpec, bench: Bench, scene: Scene) -> list[Change]:
    wanted = [(spec.effect, spec.family, spec.strength)]
    if spec.second:
        wanted.append((spec.second, ALL[spec.second].families[0], spec.strength))
    if spec.condition in ("small_modes", "small_mode"):
        wanted = [*wanted, ("missing_mode", "apart", SMALL_MODES)]
    changes: list[Change] = []
    for name, family, strength in wanted:
        if name in ("none", "modal_parameters"):
            continue
        dial = find_dial(bench, scene, ALL[name], family, strength, spec.noise)
        changes.append(ALL[name].build(scene, family, dial))
    return changes


def _lab_error(spec: CaseSpec) -> LabError:
    error = LabError.uniform(spec.nominal_off)
    return error.only(spec.family) if spec.effect == "modal_parameters" else error


def _record(
    spec: CaseSpec, bench: Bench, changes: list[Change], nominal: ModalModel, level: str
) -> tuple[NDArray[np.float64], dict[str, Any]]:
    """Samples (n, 6) of a level, and what is true of them."""
    rng = np.random.default_rng([spec.seed, 77, list(LEVELS).index(level)])
    forces, clean = bench.observed(level, changes, 16)
    motion = clean.copy()
    noise = measurement_noise(clean[KEPT], spec.noise, spec.colour, rng)
    force_noise = np.zeros_like(forces)
    force_noise[KEPT] = measurement_noise(forces[KEPT], 0.5 * spec.noise, "white", rng)
    motion[KEPT] += noise
    motion = _converted(motion, changes, np.random.default_rng(bench.seed))
    believed = Structure(nominal.poles, nominal.left, nominal.right[:, :3], nominal.left)
    error = motion - linear_response(believed, forces + force_noise)
    passed_on = linear_response(bench.structure, force_noise)[KEPT].std(axis=0)
    residual = _converted(clean, changes, rng) - linear_response(bench.structure, forces)
    left = np.stack([residual[KEPT].std(axis=0), motion[KEPT].std(axis=0)])
    facts: dict[str, Any] = {
        "residual_over_noise": over_noise(left, spec.noise),
        "acceleration_rms": motion[KEPT].std(axis=0).tolist(),
        "nominal_error_rms": error[KEPT].std(axis=0).tolist(),
        "noise_floor_rms": np.hypot(noise.std(axis=0), passed_on).tolist(),
    }
    if level == "mid":
        left[0] = after_refit(bench.structure, forces, residual)
        facts["residual_after_refit_over_noise"] = over_noise(left, spec.noise)
    return np.hstack([forces + force_noise, motion])[KEPT], facts


def _truth(spec: CaseSpec, scene: Scene, changes: list[Change], facts: dict[str, dict[str, Any]]) -> dict[str, Any]:
    effects = [name for name in (spec.effect, spec.second) if name and name != "none"]
    foreign = [name for name in effects if name in FOREIGN and not ALL[name].answer]
    also = ["missing_mode"] if spec.condition in ("small_modes", "small_mode") else []
    if spec.nominal_off > 1.5 and spec.effect != "modal_parameters":
        also.append("modal_parameters")
    directed = bool(effects) and ALL[spec.effect].directional and spec.condition != "inner_joint"
    return {
        "spec": spec.to_json(),
        "effects": ["unexplained"] if foreign else [ALL[name].answer or name for name in effects],
        "accepted_also": also,
        "joint_direction_at_tcp": scene.direction.tolist() if directed else None,
        "parameters": [change.parameters for change in changes],
        "residual_over_noise": facts["mid"]["residual_over_noise"],
        "residual_after_refit_over_noise": facts["mid"].pop("residual_after_refit_over_noise"),
        "recordings": facts,
    }
