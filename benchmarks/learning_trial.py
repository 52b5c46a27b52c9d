"""Trial of `learn`: random cells whose prior is wrong, ten cuts each, judged by multipliers that share no code.

`python -m benchmarks.learning_trial --out DIR [--cells 50] [--seed 1]`. The prior is 5 % off in each natural frequency
and 20 % in each coefficient (standard errors, stated as such). The first cut is the one advised; each further cut, at
one of five speeds in turn, is at the median of the limits learned so far. One verdict in a hundred is wrong. Chatter
frequencies come from a simulation in which teeth leave the cut. Started again, it goes on where it was.

`python -m benchmarks.learning_trial --frequencies 60` compares simulated chatter frequencies with the multipliers.
"""

import argparse
import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.cell_trial.judge import lowest_limit, radius
from benchmarks.cell_trial.robot_cell import Cut, Structure
from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.stability import (
    BandedLimits,
    Learned,
    ProductionCut,
    learned_cut,
    learned_in_turn,
    learned_limits,
    lowest_limits,
    multipliers,
    simulate_cut,
)
from millfrf.stability.drawn_structures import NormalErrors
from modal_fit import ModalModel
from tests.stability.drawn_cuts import random_case

Real = NDArray[np.float64]
CUTS = 10
MAX_DEPTH = 0.02  # m, the diameter of the cutter
WRONG = 0.01  # share of verdicts that are wrong
DRIFT = 0.02
CONFIDENCE = 0.975


@dataclass
class WrongCell:
    """A prior, the truth drawn from it, and what is made of it."""

    model: ModalModel
    process: MillingProcess
    true_model: ModalModel
    true_process: MillingProcess
    speeds: Real  # rad/s
    generator: np.random.Generator
    wrong_verdicts: int = 0
    next_cut: tuple[float, float] = (0.0, 0.0)
    advised: list[dict[str, Any]] = field(default_factory=list)

    @classmethod
    def drawn(cls, number: int, seed: int) -> "WrongCell":
        """Draw a cell: one to three modes, two to four teeth, slot to a small width; damping and shapes off, too."""
        case, generator = random_case(1000 * seed + number), np.random.default_rng([seed, number])
        assert case.model.covariance is not None
        errors, n_modes = np.sqrt(np.diag(case.model.covariance)), len(case.model.poles)
        errors[n_modes : 2 * n_modes] = 0.05 * case.model.poles.imag
        model, cut = replace(case.model, covariance=np.diag(errors**2)), case.cut
        process = replace(cut, ktc_std=0.2 * cut.ktc, krc_std=0.2 * cut.krc, kac_std=0.2 * cut.kac)
        prior = NormalErrors.of(model, process)
        return cls(model, process, *prior.at(prior.numbers(generator)), case.speeds[::3], generator)

    @property
    def judged(self) -> tuple[Structure, Cut]:
        """The truth as the independent judge takes it."""
        m, p = self.true_model, self.true_process
        cut = Cut(p.teeth, p.diameter, p.start_angle, p.exit_angle, p.ktc, p.krc, p.kac, p.feed_per_tooth)
        return Structure(m.poles, m.right, m.right, m.left), cut

    def cuts(self) -> Iterator[ProductionCut]:
        """Make one cut after the other at the speed and depth set before."""
        for number in range(1, CUTS + 1):
            speed, depth = self.next_cut
            chatters, frequency = radius(*self.judged, speed, depth) >= 1, math.nan
            if self.generator.random() < WRONG:
                chatters, self.wrong_verdicts = not chatters, self.wrong_verdicts + 1
            error = 0.0
            if chatters:
                frequency = simulated_frequency(self.true_model, self.true_process, speed, depth)
                error = 0.0 if math.isnan(frequency) else 1e-3 * frequency  # a wrong verdict may have no frequency
            verdict = "hopf" if chatters else "stable"
            yield ProductionCut(f"cut {number}", speed, depth, verdict, frequency, error)

    def advise(self, learned: Learned, limits: BandedLimits) -> None:
        """Note the advised cut and how it is judged; choose the next cut."""
        number = len(learned.evidence)
        facts: dict[str, Any] = {"cuts": number, "effective": learned.after.effective, "verdict": learned.verdict}
        try:
            cut = learned_cut(learned, limits, confidence=CONFIDENCE, drift=DRIFT)
        except InputError as error:
            self.advised.append(facts | {"reason": str(error)})
        else:
            speed, depth = cut.spindle_speed, cut.depth
            true = lowest_limit(*self.judged, speed, 2 * MAX_DEPTH)
            radii = [radius(*self.judged, share * speed, depth) for share in (0.98, 1.0, 1.02)]
            self.advised.append(
                facts | {"speed": speed, "depth": depth, "radii": radii, "true_limit": true, "removal": cut.removal}
            )
            if number == 0:
                self.next_cut = (speed, depth)
                return
        speed = float(self.speeds[(2 * number) % len(self.speeds)])
        middle = np.median(np.minimum(_limits(learned, np.array([speed]), 19), MAX_DEPTH))
        self.next_cut = (speed, float(middle))


def _limits(learned: Learned, speeds: Real, count: int) -> Real:
    from millfrf.stability.limit_interval import sampled_limits

    return np.asarray(sampled_limits(learned.after.chosen(count, 7), speeds, MAX_DEPTH))


def simulated_frequency(model: ModalModel, process: MillingProcess, speed: float, depth: float) -> float:
    """Strongest line (Hz) that is no harmonic of the tooth passing, in the last half of a simulated cut; NaN: none."""
    try:
        run = simulate_cut(model, process, speed, depth)
    except InputError:
        return math.nan
    a_period = run.steps // process.teeth
    motion = run.motion[-(len(run.motion) // 2 // a_period * a_period) :]
    if run.repeats or not np.isfinite(motion).all():
        return math.nan
    of_periods = motion.reshape(-1, a_period, 3)
    rest = (of_periods - of_periods.mean(axis=0)).reshape(-1, 3) * np.hanning(len(motion))[:, None]
    spectrum = np.abs(np.fft.rfft(rest, 16 * len(rest), axis=0)).sum(axis=1)
    return float(np.fft.rfftfreq(16 * len(rest), run.times[1] - run.times[0])[np.argmax(spectrum)])


def run_cell(number: int, seed: int) -> dict[str, Any]:
    """Ten cuts of one cell, with the advice before and after each, and the limits before and after all."""
    began, cell = time.process_time(), WrongCell.drawn(number, seed)
    curves: list[Real] = []
    refused = ""
    try:
        for learned in learned_in_turn(cell.model, cell.process, cell.cuts(), seed=number):
            limits = learned_limits(learned, cell.speeds, MAX_DEPTH)
            cell.advise(learned, limits)
            if len(learned.evidence) in (0, CUTS):
                middle = np.median(np.minimum(_limits(learned, cell.speeds, 79), MAX_DEPTH), axis=0)
                curves.append(np.array([limits.band.low, middle, limits.band.high]))
    except InputError as error:  # too few structures are left: learn asks for a new measurement
        refused = str(error)
    true = [lowest_limit(*cell.judged, float(speed), MAX_DEPTH) for speed in cell.speeds]
    return {
        "number": number,
        "modes": len(cell.model.poles),
        "wrong_verdicts": cell.wrong_verdicts,
        "contradictions": learned.contradictions,
        "refused": refused,
        "cuts": [
            [each.cut.spindle_speed, each.cut.depth, each.cut.verdict, each.expected] for each in learned.evidence
        ],
        "advised": cell.advised,
        "true": true,
        "before": curves[0].tolist(),
        "after": None if refused else curves[1].tolist(),
        "seconds": time.process_time() - began,
    }


def table_of(results: list[dict[str, Any]]) -> str:
    """Errors and coverage of the limits, and the advice, of all cells."""
    refused = [each for each in results if each["refused"]]
    agreed = [each for each in results if not each["contradictions"] and not each["refused"]]
    errors: dict[str, list[float]] = {"before": [], "after": []}
    inside: dict[str, list[bool]] = {"before": [], "after": []}
    for each in agreed:
        true = np.array(each["true"], dtype=float)
        for when in errors:
            low, middle, high = np.array(each[when], dtype=float)
            limited = true < MAX_DEPTH
            errors[when] += np.abs(np.log(middle[limited] / true[limited])).tolist()
            inside[when] += ((low <= true) & (true <= high)).tolist()
    advice = [cut for each in results for cut in each["advised"] if "depth" in cut]
    unsafe = [cut for cut in advice if cut["radii"][1] >= 1]
    drifting = [cut for cut in advice if max(cut["radii"]) >= 1]
    lines = [
        f"cells {len(results)}, refused {len(refused)}, "
        f"with a contradiction {len(results) - len(agreed) - len(refused)} "
        f"(with a wrong verdict: {sum(each['wrong_verdicts'] > 0 for each in results if each['contradictions'])})",
        f"wrong verdicts {sum(each['wrong_verdicts'] for each in results)} of {CUTS * len(results)}",
        *(
            f"limits {when}: median error {np.median(errors[when]):.3f}, in the 95 % band {np.mean(inside[when]):.3f} "
            f"of {len(inside[when])}"
            for when in errors
        ),
        f"advised cuts {len(advice)}, unstable {len(unsafe)}, within the drift {len(drifting)}",
        f"median removal of the last advice over the first: {_gain(agreed):.2f}",
        f"effective draws: least {min(cut['effective'] for each in results for cut in each['advised']):.0f}",
        f"seconds a cell: median {np.median([each['seconds'] for each in results]):.0f}",
    ]
    return "\n".join(lines) + "\n"


def _gain(results: list[dict[str, Any]]) -> float:
    pairs = [(each["advised"][0], each["advised"][-1]) for each in results]
    return float(
        np.median(
            [last["removal"] / first["removal"] for first, last in pairs if "removal" in first and "removal" in last]
        )
    )


def compare_frequencies(count: int) -> str:
    """Compare chatter frequencies of simulated cuts at 1.1, 1.5 and 2 times the limit with those of the multipliers."""
    rows = []
    for seed in range(count):
        case = random_case(seed)
        speed = float(case.speeds[(7 * seed) % 25])
        limit = float(lowest_limits(case.model, case.cut, np.array([speed]), 0.05).lowest().depth_limits[0])
        passing = case.cut.teeth * speed / (2 * math.pi)
        for ratio in (1.1, 1.5, 2.0) if math.isfinite(limit) else ():
            frequency = simulated_frequency(case.model, case.cut, speed, ratio * limit)
            value = multipliers(case.model, case.cut, speed, ratio * limit).values[0]
            turns = frequency / passing
            apart = abs(abs(turns - round(turns)) - abs(np.angle(value)) / (2 * math.pi)) * passing / frequency
            rows.append((math.log(abs(value)), apart))
    growth, apart = np.array([row for row in rows if math.isfinite(row[1])]).T
    lines = []
    for low, high in ((0.0, 0.05), (0.05, 0.1), (0.1, 0.2), (0.2, 0.4), (0.4, 9.0)):
        chosen = apart[(growth >= low) & (growth < high)]
        lines.append(
            f"growth {low:g} to {high:g}: {len(chosen)} cuts, half within {np.median(chosen):.4f}, "
            f"{np.mean(chosen > 0.05):.2f} beyond 0.05"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run what has not been run, then print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--cells", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--frequencies", type=int, default=0, help="Compare frequencies of this many cells instead.")
    asked = parser.parse_args()
    if asked.frequencies or asked.out is None:
        print(compare_frequencies(asked.frequencies or 60))
        return
    asked.out.mkdir(parents=True, exist_ok=True)
    for number in range(asked.cells):
        place = asked.out / f"cell_{number:03d}.json"
        if not place.exists():
            place.write_text(json.dumps(run_cell(number, asked.seed), default=float) + "\n", encoding="utf-8")
            print(number, flush=True)
    results = [json.loads(place.read_text(encoding="utf-8")) for place in sorted(asked.out.glob("cell_*.json"))]
    print(table_of(results))


if __name__ == "__main__":
    main()
