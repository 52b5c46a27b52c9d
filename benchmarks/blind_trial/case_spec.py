"""`CaseSpec`: everything that decides a case, and the stratified draw of many."""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from .effects import ALL, FOREIGN, LISTED
from .further_groups import EXTENDED, FURTHER, further_case

STRENGTHS = (0.5, 1.0, 2.0, 5.0, 20.0)
NOISES = (0.01, 0.02, 0.03)
EXCITATIONS = ("sweeps", "porous", "mixed")
CONTROLS = ("exact", "nominal_off", "excess_noise", "small_modes", "unknown_error")
CONDITIONS = (
    "constant_speed",
    "coloured_noise",
    "noise_5_percent",
    "sensor_away",
    "channel_missing",
    "level_missing",
    "unknown_error",
)
SHARES = {"main": 0.45, "control": 0.30, "foreign": 0.12, "pair": 0.05, "condition": 0.08}


@dataclass(frozen=True)
class CaseSpec:
    """One case.

    Parameters
    ----------
    group
        ``main`` (the grid), ``control`` (nothing to find), ``foreign``, ``pair``, ``condition``, or one of
        :data:`~benchmarks.blind_trial.further_groups.FURTHER`.
    effect, family, second
        Concealed cause, family of its law, and a further cause (empty: none).
    strength
        Wanted ratio of the response's change to the noise, both RMS over the accelerations at the middle level.
    noise, colour
        Share of each acceleration's RMS; half of it on forces.
    joint
        Axis (0, 1, 2) to which the joint's random direction is nearest.
    nominal_off
        Error of the nominal model in units of a lab's usual one.
    condition
        Condition of the measurement, or the kind of control.
    """

    index: int
    seed: int
    group: str
    effect: str
    family: str
    strength: float
    noise: float
    excitation: str
    joint: int
    nominal_off: float
    colour: str = "white"
    condition: str = "standard"
    second: str = ""

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        return asdict(self)


def full_grid() -> Iterator[CaseSpec]:
    """Every listed effect x strength x noise x excitation x joint; families and nominal errors are drawn later."""
    names = (*LISTED, "modal_parameters")
    for effect, strength, noise, excitation, joint in product(names, STRENGTHS, NOISES, EXCITATIONS, range(3)):
        yield CaseSpec(0, 0, "main", effect, "", strength, noise, excitation, joint, 0.0)


def draw_cases(n: int, seed: int, *, only: str = "", whole_grid: bool = False) -> list[CaseSpec]:
    """A stratified draw of ``n`` cases, the same for the same arguments.

    Effects and strengths of the grid come in equal numbers, the rest of it at random; ``whole_grid`` takes all of it
    and adds the other groups in proportion. At least 300 controls where ``n`` is 900 or more.

    Parameters
    ----------
    only
        One effect, group or condition; all ``n`` cases are of it. ``extended``: all groups, the harder ones too.
    """
    rng = np.random.default_rng(seed)
    if whole_grid:
        grid = list(full_grid())
        cases = grid + [c for c in _mixture(round(len(grid) / SHARES["main"]), rng) if c.group != "main"]
    elif only:
        cases = _filtered(n, only, rng)
    else:
        cases = _mixture(n, rng)
    order = rng.permutation(len(cases))
    return [_completed(cases[k], index, seed, rng) for index, k in enumerate(order)]


def _mixture(n: int, rng: np.random.Generator, shares: Mapping[str, float] = SHARES) -> list[CaseSpec]:
    counts = {group: round(share * n) for group, share in shares.items()}
    counts["main"] = n - sum(count for group, count in counts.items() if group != "main")
    return [case for group, count in counts.items() for case in _group(group, count, rng)]


def _filtered(n: int, only: str, rng: np.random.Generator) -> list[CaseSpec]:
    if only == "extended":
        return _mixture(n, rng, EXTENDED)
    if only in EXTENDED:
        return _group(only, n, rng)
    cases: list[CaseSpec] = []
    for _ in range(200):
        pool = _mixture(1000, rng)
        cases += [case for case in pool if only in (case.effect, case.condition)]
        if len(cases) >= n:
            return cases[:n]
    raise ValueError(f"no effect, group or condition is called {only!r}")


def _group(group: str, n: int, rng: np.random.Generator) -> list[CaseSpec]:
    if group in FURTHER:
        return [_further(group, count, rng) for count in range(n)]
    names = {
        "main": (*LISTED, "modal_parameters"),
        "control": ("none",),
        "foreign": tuple(FOREIGN),
        "pair": tuple(LISTED),
        "condition": (*LISTED, "none"),
    }[group]
    cells = list(product(names, STRENGTHS if group != "control" else CONTROLS))
    cases: list[CaseSpec] = []
    while len(cases) < n:
        for k in rng.permutation(len(cells)):
            effect, level = cells[k]
            condition = level if isinstance(level, str) else "standard"
            strength = 0.0 if isinstance(level, str) else level
            common = (float(rng.choice(NOISES)), str(rng.choice(EXCITATIONS)), int(rng.integers(3)), 0.0)
            case = CaseSpec(0, 0, group, effect, "", strength, *common, condition=condition)
            cases.append(_special(case, len(cases), rng))
    return cases[:n]


def _further(group: str, count: int, rng: np.random.Generator) -> CaseSpec:
    """A case of a harder group."""
    single = further_case(group, count, rng)
    joint = int(rng.integers(3))
    case = CaseSpec(0, 0, group, single.effect, "", single.strength, single.noise, single.excitation, joint, 0.0)
    return replace(case, condition=single.condition)


def _special(case: CaseSpec, count: int, rng: np.random.Generator) -> CaseSpec:
    """What sets pairs and conditions apart."""
    if case.group == "pair":
        others = [name for name in LISTED if name != case.effect]
        return replace(case, second=str(rng.choice(others)), strength=max(case.strength, 2.0))
    if case.group != "condition":
        return case
    case = replace(case, condition=CONDITIONS[count % len(CONDITIONS)], strength=max(case.strength, 1.0))
    if case.effect == "none":
        return replace(case, strength=0.0)
    return case


def _completed(case: CaseSpec, index: int, seed: int, rng: np.random.Generator) -> CaseSpec:
    """Give a case its number, seed, family, nominal error, and the numbers its condition asks for."""
    family = str(rng.choice(ALL[case.effect].families))
    off = 0.0 if rng.random() < 0.25 else 1.0
    noise, colour, excitation = case.noise, case.colour, case.excitation
    if case.condition == "unknown_error":
        off = float(rng.uniform(0.3, 2.0))
    if case.effect == "modal_parameters":
        off = float(rng.uniform(3.0, 6.0))
    if case.condition in ("exact", "nominal_off"):
        off = float(case.condition == "nominal_off")
    if case.condition in ("excess_noise", "noise_5_percent"):
        noise = 0.05 if case.condition == "noise_5_percent" else float(rng.uniform(0.05, 0.10))
    if case.condition == "coloured_noise" or (case.group == "control" and rng.random() < 0.2):
        colour = str(rng.choice(["pink", "hum"]))
    if case.condition == "constant_speed":
        excitation = "constant"
    own = int(np.random.SeedSequence([seed, index]).generate_state(1)[0])
    return replace(
        case, index=index, seed=own, family=family, nominal_off=off, noise=noise, colour=colour, excitation=excitation
    )
