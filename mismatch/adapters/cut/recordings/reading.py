"""Reading a recording of a cut: forces and motion at the tip, and the speed that it states."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel, Recording, Stream, aligned_samples
from cutting import MillingProcess, refuse_varied
from foundation import DegreeOfFreedom, InputError
from modal_fit import ModalModel

from ....records.trial import POWERS
from .recording import TIP, CutRecording, cut_recording
from .spindle_law import stated_law

Real = NDArray[np.float64]


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
        Cutter.
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
        forces = [_channel(source, label, ("force",)) for label in TIP]
        motions = [_channel(source, label, tuple(POWERS)) for label in TIP]
        axes = tuple(axis for axis, found in enumerate(forces) if found is not None)
        rate = source.sample_rate
        if not {0, 1} <= set(axes):
            there = ", ".join(f"{c.name} ({c.quantity} {c.degree_of_freedom})" for c in source.channels)
            raise InputError(f"{Path(path).name}: forces at TCP:+X and TCP:+Y are needed; it has {there}")
        force = _samples(source, [one for one in forces if one is not None])
        wanted = (0, 1) if process.edge_angle > np.pi / 2 - 1e-6 else (0, 1, 2)
        moving = [motions[axis] for axis in wanted]
        known = [one for one in moving if one is not None]
        samples = _samples(source, known) if len(known) == len(wanted) else None
    quantities = [one[0].quantity for one in known]
    return cut_recording(
        Path(path).stem, rate, force, axes, process, stated,
        motion=None if samples is None else (samples, wanted, tuple(POWERS[quantity] for quantity in quantities)),
        model=model,
    )  # fmt: skip


def _channel(stream: Stream, label: str, quantities: tuple[str, ...]) -> tuple[Channel, float] | None:
    aim = DegreeOfFreedom.parse(label)
    for channel in stream.channels:
        if channel.quantity in quantities and channel.node:
            here = DegreeOfFreedom(channel.node, channel.direction)
            if (here.node, here.axis) == (aim.node, aim.axis):
                return channel, float(here.sign * aim.sign)
    return None


def _samples(stream: Stream, found: Sequence[tuple[Channel, float]]) -> Real:
    names = [channel.name for channel, _ in found]
    samples = np.asarray(aligned_samples(stream, names) * np.array([sign for _, sign in found]))
    bad = ~np.isfinite(samples).all(axis=0)
    if bad.any():
        name = names[int(np.argmax(bad))]
        raise InputError(f"{stream.path.name}: channel {name} holds values that are not finite; cut them out first")
    return samples
