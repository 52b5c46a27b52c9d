"""SDynPy: `PolyPy`, its poly-reference fitter, as its tutorial on modal tests uses it without the window.

The derivative of displacement is told (it fits acceleration), references are the shorter side of the matrix (a roving
hammer's FRFs are read by reciprocity, as its users label them). Its choice of poles is by hand in a chart; here it is
that of :mod:`.stable_clusters`, with the participation factors as vectors.
"""

import contextlib
import io
import os

import numpy as np

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")  # its import asks for a window system
import sdynpy

from .problem import DERIVATIVES, Answer, Problem
from .stable_clusters import OrderPoles, candidates, choose


def find_modes(problem: Problem) -> Answer:
    """Poles of the orders in :func:`polynomial_orders`, chosen automatically."""
    orders = chart(problem)
    return Answer(choose(orders, problem.band), candidates=candidates(orders, problem.band))


def polynomial_orders(n_references: int, n_lines: int) -> range:
    """From 10 (its window's default) by 2 to 80 for one reference, down to 40 for four and more.

    The window ends at 30, which is too few for 15 modes of one reference; of 30, 40, 60 and 80 this finds the most (16
    sets of seed 1001). Where lines are few a third of them is the end.
    """
    return range(10, max(14, min(n_lines // 3, max(40, 80 - 15 * (n_references - 1)))) + 1, 2)


def chart(problem: Problem) -> list[OrderPoles]:
    """Poles of all orders, lowest first."""
    values = np.moveaxis(problem.values, 0, 2)
    if values.shape[1] > values.shape[0]:
        values = values.transpose(1, 0, 2)
    n_points, n_references, _ = values.shape
    nodes = np.moveaxis(np.indices((n_points, n_references)), 0, -1) + [1, 1001]
    coordinates = sdynpy.coordinate_array(nodes, 3)
    with contextlib.redirect_stdout(io.StringIO()):
        frfs = sdynpy.data_array(
            sdynpy.data.FunctionTypes.FREQUENCY_RESPONSE_FUNCTION, problem.frequencies, values, coordinates
        )
        derivative = DERIVATIVES[problem.quantity]
        fitter = sdynpy.PolyPy(frfs, *problem.band, displacement_derivative=derivative)
        fitter.compute_poles(np.array(polynomial_orders(n_references, int(problem.inside().sum()))))
    charts = []
    for result in fitter.pole_list[::-1]:
        omega, zeta = result["omega"], result["zeta"]
        poles = omega * (-zeta + 1j * np.sqrt(np.maximum(1 - zeta**2, 0)))
        charts.append(OrderPoles(poles, result["Lr_complex"]))
    return charts
