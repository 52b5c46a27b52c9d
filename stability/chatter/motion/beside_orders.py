"""Lines close beside an order of the spindle: chatter stands on one side of it, an order that varies on both."""

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

ONE_SIDED = 10.0
"""Power of a line over that at the same distance beyond the order, from which it is none of the order's own."""
OF_THE_ORDER = 0.1
"""Its power over the order's, from which a slow change of the order does not explain it."""


def stand_aside(power: Real, count: int, order_power: Real) -> NDArray[np.bool_]:
    """Say which lines of a spectrum stand beside an order and are none of its own.

    An order whose size or angle varies slowly has two lines of equal size beside it. Chatter whose frequency comes
    close to an order has one.

    Parameters
    ----------
    power : (n_lines,)
        Mean square a line of resolution, all channels together, orders taken away.
    count
        Lines of resolution from one order to the next.
    order_power : (n_orders,)
        Mean square of each order from 0 on, all channels together.

    Returns
    -------
    (n_lines,)
        True for such lines, away from all orders too.

    Examples
    --------
    >>> power = np.full(31, 1e-6)
    >>> power[[9, 11, 18]] = 0.2, 0.2, 0.3  # two lines beside the first order, one beside the second
    >>> np.flatnonzero(stand_aside(power, 10, np.ones(3)))
    array([18])
    """
    lines = np.arange(len(power))
    nearest = np.round(lines / count).astype(int)
    beyond = 2 * nearest * count - lines
    known = (beyond >= 0) & (beyond < len(power)) & (nearest < len(order_power)) & (beyond != lines)
    result = np.zeros(len(power), dtype=bool)
    mirrored, order = power[beyond[known]], order_power[nearest[known]]
    result[known] = (power[known] > ONE_SIDED * mirrored) & (power[known] > OF_THE_ORDER * order)
    return result
