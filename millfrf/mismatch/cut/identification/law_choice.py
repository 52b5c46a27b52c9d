"""Choice between constant coefficients with edge forces and coefficients that fall with the chip thickness."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from .coefficient_fit import CoefficientFit, fit_at, fit_cuts, fitted_problem
from .cut_forces import CutForces
from .force_problem import EDGES, EDGES_AND_EXPONENTS, EXPONENTS, At, ForceLaw
from .placements import CHANCE


@dataclass(frozen=True)
class LawChoice:
    """Law of the force that the waveforms need, and the F-tests that decided.

    Parameters
    ----------
    law
        Law that was chosen.
    fit
        Fit with this law.
    without_exponents
        Probability of so large a misfit of edge forces alone where exponents are zero.
    without_edges
        Probability of so large a misfit of exponents alone where edge forces are zero.
    misfit
        Misfit with both.
    """

    law: ForceLaw
    fit: CoefficientFit
    without_exponents: float
    without_edges: float
    misfit: float

    @property
    def sentence(self) -> str:
        """Say which law was chosen, and why."""
        words = {
            EDGES: "constant coefficients with edge forces",
            EXPONENTS: "coefficients that fall with the chip thickness",
            EDGES_AND_EXPONENTS: "coefficients that fall with the chip thickness, with edge forces",
        }
        tests = f"F-tests: exponents p = {self.without_exponents:.2g}, edge forces p = {self.without_edges:.2g}"
        if self.law == EDGES and self.without_exponents >= CHANCE and self.without_edges >= CHANCE:
            return f"these cuts do not tell exponents from edge forces, and {words[self.law]} are used ({tests})"
        return f"the forces need {words[self.law]} ({tests})"


def choose_law(
    cuts: Sequence[CutForces], constant: CoefficientFit, moved: Sequence[Sequence[CutForces]], explained: float
) -> LawChoice | None:
    """Choose the law that the forces need by F-tests inside the law with edge forces and exponents.

    Neither of both laws is a case of the other, but both are cases of a third with edge forces and exponents. A part of
    it is needed if leaving it out raises the misfit by more than chance, with the same weights. Constant coefficients
    stay where neither part is needed.

    Parameters
    ----------
    cuts
        Forces of the cuts, with the edge radius in their processes.
    constant
        Their fit with constant coefficients.
    moved
        As for :func:`fit_cuts`.
    explained
        Largest misfit with which the waveforms count as explained; above it None is returned.
    """
    problem, best = fitted_problem(cuts, EDGES_AND_EXPONENTS, constant)
    whole = fit_at(problem, best, moved)
    if whole.misfit > explained:
        return None
    power = problem.misfit(best)

    def chance(law: ForceLaw, start: At) -> float:
        part = replace(problem, law=law)
        left_out = len(problem.known) + len(problem.bent) - len(part.known) - len(part.bent)
        ratio = (part.misfit(part.refined(start)) - power) / left_out / (power / whole.freedom)
        return float(scipy.stats.f.sf(max(ratio, 0.0), left_out, whole.freedom))

    without_exponents = chance(EDGES, At(constant.angles, np.array(constant.runout)))
    without_edges = chance(EXPONENTS, best)
    if without_exponents >= CHANCE:
        law, fit = EDGES, constant
    elif without_edges >= CHANCE:
        law, fit = EXPONENTS, fit_cuts(cuts, moved, law=EXPONENTS, near=constant)
    else:
        law, fit = EDGES_AND_EXPONENTS, whole
    return LawChoice(law, fit, without_exponents, without_edges, whole.misfit)
