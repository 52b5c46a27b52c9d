"""pyOMA-2: output-only, so that its classes cannot take FRFs; its function `plscf.pLSCF` can, as half spectra.

A positive half spectrum and an FRF are the same sum over poles (Peeters & Van der Auweraer, PolyMAX: a revolution in
operational modal analysis, IOMAC 2005), so the estimator itself is judged on what it is for. Its other methods (FDD,
EFDD, FSDD, SSI) begin with responses over time and are left out. References are the shorter side of the matrix; the
band's lines stand for those of a half spectrum from 0 Hz, and poles are moved back by the band's edge. Poles are chosen
by :mod:`.stable_clusters`, after the package's own criterion that poles come as conjugates.
"""

import contextlib
import io
import logging

import numpy as np
from pyoma2.functions import gen, plscf

from .problem import Answer, Problem
from .stable_clusters import OrderPoles, candidates, choose


def find_modes(problem: Problem) -> Answer:
    """Poles of all orders, chosen automatically."""
    orders = chart(problem)
    return Answer(choose(orders, problem.band), candidates=candidates(orders, problem.band))


def highest_order(n_references: int, n_lines: int) -> int:
    """60 for one reference, down to 30 for four and more; a third of the lines where they are few."""
    return max(10, min(n_lines // 3, max(30, 60 - 10 * (n_references - 1))))


def chart(problem: Problem) -> list[OrderPoles]:
    """Poles of all orders, lowest first."""
    logging.disable(logging.CRITICAL)
    inside = problem.inside()
    frequencies, values = problem.frequencies[inside], np.moveaxis(problem.values[inside], 0, 2)
    if values.shape[1] > values.shape[0]:
        values = values.transpose(1, 0, 2)
    step = 1 / (2 * (frequencies[-1] - frequencies[0]))
    with contextlib.redirect_stderr(io.StringIO()), contextlib.redirect_stdout(io.StringIO()):
        top = highest_order(values.shape[1], len(frequencies))
        denominators, numerators = plscf.pLSCF(np.ascontiguousarray(values), step, top, sgn_basf=1)
        _, _, vectors, poles = plscf.pLSCF_poles(denominators, numerators, step, "per", 2 * len(frequencies))
        poles, _ = gen.HC_conj(poles)
    shift = 2j * np.pi * frequencies[0]
    return [OrderPoles(poles[:, k] + shift, vectors[:, k, :]) for k in range(poles.shape[1])]
