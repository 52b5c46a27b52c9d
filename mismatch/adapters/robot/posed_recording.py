"""`PosedRecording`: one recording, the posture it was made in, and its spectrum in the band that is compared."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import Recording, Stream
from estimation import (
    DERIVATIVE_ORDERS,
    BandRecording,
    WindowedSpectrum,
    channel_at,
    channels_in_words,
    names_at,
    windowed_spectrum,
)
from foundation import HOUSING, TIP, InputError
from modal_fit import ModalModel

from ...records import read_at

Real = NDArray[np.float64]


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
    spectrum: WindowedSpectrum

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.spectrum.recording.name


def posed(
    recording: BandRecording,
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
        Columns X, Y, Z of the channels in the base frame; None: the channels have the base frame's axes.
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
    spectrum = windowed_spectrum(recording, band, decay)
    if len(spectrum.frequencies) < 50:
        raise InputError(
            f"{recording.name}: {len(spectrum.frequencies)} lines between {band[0]:g} and {band[1]:g} Hz; "
            "50 are the least: record longer, or widen the band"
        )
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    return PosedRecording(np.asarray(q, dtype=float), turn, tuple(responses), tuple(excitations), spectrum)


def posed_channels(stream: Stream) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the channels that a robot's diagnosis uses: forces at the tip, and motions at the tip or the housing."""

    forces = names_at(stream.channels, TIP, ("force",))
    return forces, names_at(stream.channels, (*TIP, *HOUSING), DERIVATIVE_ORDERS)


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
        File of the recording.
    q : (n_moving,), rad
        Joint values as stated.
    model
        The robot's modal model in this posture, with the modes of the band: it says how fast the recording must be
        sampled.
    band
        Lowest and highest frequency that are compared, Hz.
    axes : (3, 3)
        Columns X, Y, Z of the channels in the base frame; None: the channels have the base frame's axes.
    stream
        Sample clock; None: the only one.

    Raises
    ------
    InputError
        No force at the tip, no motion at tip or housing, or what :func:`mismatch.read_recording` refuses.
    """
    with Recording(path) as recording:
        channels = recording.stream(stream).channels
    excitations = tuple(label for label in TIP if channel_at(channels, label, ("force",)))
    responses = tuple(label for label in (*TIP, *HOUSING) if channel_at(channels, label, DERIVATIVE_ORDERS))
    if not (excitations and responses):
        raise InputError(
            f"{Path(path).name}: a force at TCP and a motion at TCP or HOUSING are needed; "
            f"it has {channels_in_words(channels)}"
        )
    found = read_at(path, excitations, responses, replace(model, band=None), stream=stream)
    decay = float((-model.poles.real).min())
    return posed(found, q, band, responses=responses, excitations=excitations, axes=axes, decay=decay)


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
    whole, frequencies = recording.spectrum.recording, recording.spectrum.frequencies
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
