"""Reading a recording of a cut: forces and motion at the tip, and the speed that it states."""

import os
from fractions import Fraction

import numpy as np

from acquisition import Recording, Stream
from cutting import MillingProcess, refuse_varied
from estimation import (
    DERIVATIVE_ORDERS,
    MatchedChannel,
    band_recording,
    before_force_high_pass,
    channel_at,
    channels_in_words,
    high_pass_corners,
    require_room_at_rate,
)
from foundation import TIP, InputError
from modal_fit import ModalModel

from .recording import CutRecording, cut_recording
from .spindle_law import stated_law


def read_cut_recording(
    path: str | os.PathLike[str],
    process: MillingProcess,
    *,
    speed: float | None = None,
    model: ModalModel | None = None,
    stream: str | None = None,
) -> CutRecording:
    """Read one recording of a cut.

    Parameters
    ----------
    path
        Recording with forces at ``TCP``, X and Y at least; motion at ``TCP`` if it was measured.
    process
        Cutter, engagement and coefficients of the cut.
    speed
        Spindle speed, rad/s, within two per cent; None: as the recording states it.
    model
        Receptance of the tip, for its motion where none was measured there.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        A force is missing, values are not finite, no speed is stated or found, or the record is too short.
    """
    refuse_varied(
        process, "the comparison of cutting forces", "cut with straight edges at equal pitch", takes=("damping",)
    )
    if not process.feed_per_tooth > 0:
        raise InputError("feed_per_tooth_m = 0: without a feed no force can be computed; give it in the cutting file")
    stated = stated_law(path, speed)
    with Recording(path) as recording:
        source = recording.stream(stream)
        pushing, moving, axes, wanted = _channels(source, process)
        # at its own rate: how much of it is needed depends on the speed that is found
        whole = before_force_high_pass(band_recording(source, pushing, moving, Fraction(1)))
    return cut_recording(
        whole.name, whole.rate, whole.force, axes, process, stated,
        motion=(whole.response, wanted, whole.orders.tolist()) if moving else None,
        high_passes=high_pass_corners(whole.responses),
        model=model,
    )  # fmt: skip


def require_room_for_cut(path: str | os.PathLike[str], process: MillingProcess, stream: str | None = None) -> None:
    """Refuse a recording of a cut that :func:`read_cut_recording` has no memory for, before a sample is read.

    Parameters
    ----------
    path
        Recording with forces at ``TCP``.
    process
        Cutter and engagement: they say which motions are read.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        A force is missing, or the recording is too long; the line says how long it may be.
    """
    with Recording(path) as recording:
        source = recording.stream(stream)
        pushing, moving, _, _ = _channels(source, process)
        rate = source.sample_rate
    require_room_at_rate(path, len(pushing) + len(moving), rate, stream=stream)


def _channels(
    source: Stream, process: MillingProcess
) -> tuple[list[MatchedChannel], list[MatchedChannel], tuple[int, ...], tuple[int, ...]]:
    """Channels of the forces at the tip and of all its motions, or of none; axes of the forces and of the motions."""
    forces = [channel_at(source.channels, label, ("force",)) for label in TIP]
    motions = [channel_at(source.channels, label, DERIVATIVE_ORDERS) for label in TIP]
    axes = tuple(axis for axis, found in enumerate(forces) if found is not None)
    if not {0, 1} <= set(axes):
        there = channels_in_words(source.channels)
        raise InputError(f"{source.path.name}: forces at TCP:+X and TCP:+Y are needed; it has {there}")
    wanted = (0, 1) if process.edge_angle > np.pi / 2 - 1e-6 else (0, 1, 2)
    moving = [one for one in (motions[axis] for axis in wanted) if one is not None]
    pushing = [one for one in forces if one is not None]
    return pushing, moving if len(moving) == len(wanted) else [], axes, wanted
