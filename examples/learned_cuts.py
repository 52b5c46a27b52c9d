"""What `millfrf learn` makes of eight cuts: limits with their bands before and after, and the cuts as marks.

Run it: `python examples/learned_cuts.py [PICTURE.png]`. The truth is the cell of Table 1 of Mohammadi & Ahmadi in half-
immersion down milling. The prior is wrong by 3 % in both natural frequencies and by 25 % in Ktc, with standard errors
of 3 and 20 %. Verdicts are those of the true multipliers.
"""

import sys
from dataclasses import replace
from math import nan, pi
from pathlib import Path

import numpy as np

from millfrf.cutting import MillingProcess
from millfrf.figures import learned_figure, save_figure
from millfrf.stability import (
    Learned,
    ProductionCut,
    learned_in_turn,
    learned_limits,
    multipliers,
    prior_limits,
)
from modal_fit import ModalModel
from replay_data import table_one_model

RPM = pi / 30
CUT = MillingProcess(2, 12.7e-3, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
SPEEDS = np.linspace(550, 1000, 46) * RPM
DEEPEST = 0.006
MADE = (
    (660, 1.2e-3),
    (660, 2.4e-3),
    (800, 1.2e-3),
    (800, 2.0e-3),
    (900, 1.6e-3),
    (900, 2.6e-3),
    (600, 1.8e-3),
    (720, 2e-3),
)


def prior() -> tuple[ModalModel, MillingProcess]:
    """The wrong model and coefficients with their standard errors."""
    true = table_one_model()
    poles = true.poles.real + 1j * true.poles.imag * np.array([1.03, 0.97])
    vectors = [0.02 * np.abs(part).max(axis=1).repeat(3) for part in (true.right, true.right, true.left, true.left)]
    errors = np.concatenate([0.1 * -poles.real, 0.03 * poles.imag, *vectors])
    process = replace(CUT, ktc=1.25 * CUT.ktc, ktc_std=0.25 * CUT.ktc, krc_std=0.03, kac_std=0.06)
    return replace(true, poles=poles, covariance=np.diag(errors**2)), process


def made(rpm: float, depth: float) -> ProductionCut:
    """A cut of the truth, judged by its multipliers."""
    value = multipliers(table_one_model(), CUT, rpm * RPM, depth).values[0]
    name = f"{1e3 * depth:g} mm at {rpm:g} rpm"
    if abs(value) < 1:
        return ProductionCut(name, rpm * RPM, depth, "stable")
    passing = CUT.teeth * rpm / 60
    kind = "hopf" if abs(value.imag) > 1e-6 else "period-doubling"
    return ProductionCut(name, rpm * RPM, depth, kind, abs(np.angle(value)) / (2 * pi) * passing or nan, 0.05)


def main(picture: Path) -> Learned:
    """Learn from the cuts one after the other, print what each told, and draw the limits before and after."""
    for learned in learned_in_turn(*prior(), [made(*cut) for cut in MADE]):
        if learned.evidence:
            last = learned.evidence[-1]
            most = int(np.argmax(np.abs(last.shifts)))
            stated = f"{learned.parameters[most]} {last.shifts[most]:+.1f} errors of the prior"
            print(f"{last.cut.name}: {last.cut.verdict}, expected with {last.expected:.2f}; {stated}")
    limits = {"before": prior_limits(learned, SPEEDS, DEEPEST), "learned": learned_limits(learned, SPEEDS, DEEPEST)}
    save_figure(learned_figure(limits, learned.conclusive), picture)
    return learned


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path("learned_cuts.png"))
