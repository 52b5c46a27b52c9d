from .chart import PoleGroup, StabilisationChart, choose_poles, stabilisation_chart
from .matrix_fraction import OrderPoles, matrix_fraction_poles
from .one_pole import OnePole

__all__ = [
    "OnePole",
    "OrderPoles",
    "PoleGroup",
    "StabilisationChart",
    "choose_poles",
    "matrix_fraction_poles",
    "stabilisation_chart",
]
