"""Hammer FRFs of tip and sensor: two measurements, not one given twice, and each in its own place."""

import numpy as np

from estimation import Frf, to_receptance
from millfrf.core import InputError, shared_band
from modal_fit import ModalModel

from .frfs import check_frf
from .passivity import drive_points

ALIKE = 1e-9
"""Relative difference below which two FRFs are one: two measurements differ by their noise."""


def check_tip_and_sensor(
    model: ModalModel, tip: Frf, sensor: Frf, names: tuple[str, str] = ("the tip's FRF", "the sensor's FRF")
) -> list[str]:
    """Judge both hammer FRFs before a model is carried from sensor to tip.

    Parameters
    ----------
    model
        In-process model with responses at the sensor.
    tip, sensor
        Hammer FRFs, both excited at the tip.
    names
        Names of their files, for the message.

    Returns
    -------
    list of str
        Doubts: neither FRF is measured where it is tapped, or a mode of the model lies outside the band of the taps.

    Raises
    ------
    InputError
        One FRF given twice, tip and sensor exchanged, unlike exponential windows, or an FRF that
        :func:`check_frf` refuses.
    """
    doubts = check_frf(tip, names[0]) + check_frf(sensor, names[1])
    if tip.exponential_time_constant != sensor.exponential_time_constant:
        raise InputError(
            f"{names[0]} and {names[1]} have different exponential windows ({_window(tip)} and {_window(sensor)}): "
            "their modes have different damping; make both with one --exponential"
        )
    if tip.values.shape == sensor.values.shape and _alike(tip, sensor):
        raise InputError(
            f"{names[0]} and {names[1]} hold the same values: one FRF was given as tip and as sensor; give the "
            "response at the tip to --tip and that at the sensor to --sensor"
        )
    at_tip = bool(drive_points(tip.responses, tip.excitations))
    at_sensor = bool(drive_points(sensor.responses, sensor.excitations))
    if at_sensor and not at_tip:
        raise InputError(
            f"{names[1]} is measured where it is tapped ({sensor.responses[0]}) and {names[0]} is not "
            f"({tip.responses[0]}): tip and sensor are exchanged; swap --tip and --sensor"
        )
    if tip.responses == sensor.responses and not np.array_equal(tip.values, sensor.values):
        doubts.append(
            f"{names[0]} and {names[1]} both say that they are measured at {', '.join(tip.responses)}: they cannot "
            "be told apart; name the sensor's node and the tip's in the recordings"
        )
    if not at_tip and not at_sensor:
        doubts.append(
            f"{names[0]} is measured at {tip.responses[0]} and tapped at {tip.excitations[0]}: neither FRF is measured "
            "where it is tapped, so that nothing shows which is the tip's"
        )
    return [*doubts, *_modes_outside(model, tip, sensor)]


def _window(frf: Frf) -> str:
    tau = frf.exponential_time_constant
    return "none" if tau is None else f"{tau:.4g} s"


def _modes_outside(model: ModalModel, tip: Frf, sensor: Frf) -> list[str]:
    """Modes whose ratio of tip to sensor was not tapped."""
    band = shared_band(tip.band, sensor.band)
    if band is None:
        return []
    natural = model.natural_frequencies
    outside = natural[(natural < band[0]) | (natural > band[1])]
    if not len(outside):
        return []
    return [
        f"{len(outside)} of {len(natural)} modes of the model (at {', '.join(f'{f:.4g}' for f in outside)} Hz) lie "
        f"outside the {band[0]:g} to {band[1]:g} Hz in which both FRFs are known; tap with a tip that drives them"
    ]


def _alike(tip: Frf, sensor: Frf) -> bool:
    one, other = to_receptance(tip), to_receptance(sensor)
    both = one.valid & other.valid
    size = np.abs(one.values[both]).max(initial=0.0)
    return bool(np.abs(one.values[both] - other.values[both]).max(initial=0.0) <= ALIKE * size)
