"""`PosedRecording`: one recording, the posture it was made in, and its spectrum in the band that is compared."""

import os
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import Recording, Stream
from foundation import InputError
from modal_fit import ModalModel

from ...records.trial import POWERS, Trial, read_trial
from ...records.windowed_lines import WindowedLines, windowed_lines

Real = NDArray[np.float64]

TIP = ("TCP:+X", "TCP:+Y", "TCP:+Z")
HOUSING = ("HOUSING:+X", "HOUSING:+Y", "HOUSING:+Z")


@dataclass(frozen=True)
class PosedRecording:
    """A recording with the posture that the robot is said to have had.

    Parameters
    ----------
    q : (n_moving,), rad
        Joint values as stated.
    axes : (3, 3)
        Columns: X, Y, Z of the channels in the base frame.
    responses, excitations
        Degrees of freedom of the recording's columns, at the tip or the housing.
    spectrum
        Windowed spectrum of the recording in the band that is compared.
    """

    q: Real
    axes: Real
    responses: tuple[str, ...]
    excitations: tuple[str, ...]
    spectrum: WindowedLines

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.spectrum.trial.name


def posed(
    recording: Trial,
    q: Real,
    band: tuple[float, float],
    *,
    responses: Sequence[str] = TIP,
    excitations: Sequence[str] = TIP,
    axes: Real | None = None,
    decay: float = 2.0,
) -> PosedRecording:
    """Put a recording in the posture that it was made in.

    Parameters
    ----------
    recording
        Forces in the order of ``excitations``, responses in that of ``responses``.
    q : (n_moving,), rad
        Joint values as stated.
    band
        Lowest and highest frequency that are compared, Hz.
    responses, excitations
        Degrees of freedom of the columns, at the tip or the housing.
    axes : (3, 3)
        As :class:`PosedRecording`; None: the base frame.
    decay
        Decay rate of the slowest mode, 1/s.

    Raises
    ------
    InputError
        Degrees of freedom that are neither the tip's nor the housing's, or too few lines in the band.
    """
    strange = [label for label in (*responses, *excitations) if label not in (*TIP, *HOUSING)]
    if strange or any(label not in TIP for label in excitations):
        raise InputError(
            f"{recording.name}: a robot's model gives motion at {', '.join((*TIP, *HOUSING))} for forces at the tip, "
            f"not at {', '.join(strange) or 'the housing'}"
        )
    spectrum = windowed_lines(recording, band, decay)
    if len(spectrum.frequencies) < 50:
        raise InputError(
            f"{recording.name}: {len(spectrum.frequencies)} lines between {band[0]:g} and {band[1]:g} Hz; "
            "50 are the least: record longer, or widen --band"
        )
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    return PosedRecording(np.asarray(q, dtype=float), turn, tuple(responses), tuple(excitations), spectrum)


def posed_channels(stream: Stream) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the channels that a robot's diagnosis uses: forces at the tip, and motions at the tip or the housing."""

    def named(quantities: Collection[str], labels: Sequence[str]) -> tuple[str, ...]:
        wanted = {_axis(*label.split(":")) for label in labels}
        return tuple(
            c.name
            for c in stream.channels
            if c.node and c.quantity in quantities and _axis(c.node, c.direction) in wanted
        )

    return named(("force",), TIP), named(POWERS, (*TIP, *HOUSING))


def read_posed(
    path: str | os.PathLike[str],
    q: Real,
    model: ModalModel,
    band: tuple[float, float],
    *,
    axes: Real | None = None,
    stream: str | None = None,
) -> PosedRecording:
    """Read a recording made in a posture; every force at the tip, every motion at the tip or the housing is used.

    Parameters
    ----------
    path
        Recording.
    q : (n_moving,), rad
    model
        The robot's modal model there, modes of the band: it says how fast the recording must be sampled.
    band, axes
        As :func:`posed`.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        No force at the tip, no motion at tip or housing, or what :func:`mismatch.read_trial` refuses.
    """
    with Recording(path) as recording:
        channels = recording.stream(stream).channels
    forces = {_axis(c.node, c.direction) for c in channels if c.quantity == "force" and c.node}
    motions = {_axis(c.node, c.direction) for c in channels if c.quantity in POWERS and c.node}
    excitations = tuple(label for label in TIP if _axis(*label.split(":")) in forces)
    responses = tuple(label for label in (*TIP, *HOUSING) if _axis(*label.split(":")) in motions)
    if not (excitations and responses):
        raise InputError(
            f"{Path(path).name}: a force at TCP and a motion at TCP or HOUSING are needed; "
            f"it has {', '.join(f'{c.name} ({c.quantity} {c.degree_of_freedom})' for c in channels)}"
        )
    wanted = _over(model, responses, excitations)
    trial = read_trial(path, wanted, stream=stream)
    decay = float((-model.poles.real).min())
    return posed(trial, q, band, responses=responses, excitations=excitations, axes=axes, decay=decay)


def _axis(node: str, direction: str) -> str:
    return f"{node}:{direction.lstrip('+-')}"


def _over(model: ModalModel, responses: tuple[str, ...], excitations: tuple[str, ...]) -> ModalModel:
    """A stand-in with these degrees of freedom: poles alone matter to a reader."""
    n = len(model.poles)
    return ModalModel(
        model.poles,
        np.ones((n, len(responses)), dtype=complex),
        np.ones((n, len(excitations)), dtype=complex),
        responses,
        excitations,
    )


def halves(recording: PosedRecording) -> tuple[PosedRecording, PosedRecording]:
    """First and second half of a recording, so that one can be held out.

    Parameters
    ----------
    recording
        The whole recording.

    Raises
    ------
    InputError
        A half with too few lines.
    """
    whole, frequencies = recording.spectrum.trial, recording.spectrum.frequencies
    band = (float(frequencies[0]), float(frequencies[-1]))
    middle = len(whole.force) // 2
    cuts = (("first half", slice(0, middle)), ("second half", slice(middle, None)))
    first, second = (
        posed(
            replace(whole, name=f"{whole.name}, {name}", force=whole.force[cut], response=whole.response[cut]),
            recording.q,
            band,
            responses=recording.responses,
            excitations=recording.excitations,
            axes=recording.axes,
        )
        for name, cut in cuts
    )
    return first, second
