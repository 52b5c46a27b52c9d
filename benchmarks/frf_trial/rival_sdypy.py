"""sdypy-EMA: LSCF with a common denominator of all FRFs, as its tutorial and its showcase use it.

FRFs go in as they were measured, with ``frf_form`` named (it decides on the residuals of mode shapes only), and with
all their lines as in the tutorial: modes are picked inside the band, but ``lower`` at the band's edge would cost half
of them, for the real polynomial has no zoom (by hand 61 of 109 modes on 15 sets of seed 1001, against 104). The highest
order is its default, 100, which is better there than the tutorial's 60 (98); receptance or accelerance make no
difference. Its choice of poles is by hand in a chart; here it is that of :mod:`.stable_clusters`.
"""

import numpy as np
from sdypy import EMA

from .problem import Answer, Problem
from .stable_clusters import OrderPoles, candidates, choose

ORDER = 100


def find_modes(problem: Problem) -> Answer:
    """Poles of all orders, chosen automatically."""
    orders = chart(problem)
    return Answer(choose(orders, problem.band), candidates=candidates(orders, problem.band))


def chart(problem: Problem) -> list[OrderPoles]:
    """Poles of orders 1 to :data:`ORDER`, or to a third of the lines where they are few."""
    flat = problem.values.reshape(len(problem.frequencies), -1).T
    lowest, highest = problem.frequencies[0], problem.frequencies[-1]
    order = min(ORDER, len(problem.frequencies) // 3)
    model = EMA.Model(
        flat, problem.frequencies, lower=lowest, upper=highest, pol_order_high=order, frf_form=problem.quantity
    )
    model.get_poles(show_progress=False)
    return [OrderPoles(np.atleast_1d(poles)) for poles in model.all_poles]
