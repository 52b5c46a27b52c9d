"""Receptance of a robot in a posture, and the recordings that it is compared with."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy

from acquisition import Stream, opened
from estimation import (
    DERIVATIVE_ORDERS,
    BandRecording,
    WindowedSpectrum,
    channel_at,
    channels_in_words,
    names_at,
    windowed_spectrum,
)
from millfrf.core import HOUSING, TIP, Complex, InputError, Real
from millfrf.robot_model import SpatialRobot, damping_of_modes, housing_node, modes_at
from modal_fit import ModalModel

from ..inference.settings import LabError
from ..records.reading import read_at


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
        No force at the tip, no motion at tip or housing, or what :func:`millfrf.mismatch.read_recording` refuses.
    """
    with opened(path) as recording:
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


MARGIN = 2
"""Modes beyond those that may deviate which take part when modes are paired."""

PAIRED = 0.1
"""Difference of ln frequency that counts as much against a pair as a quarter of the shape."""


@dataclass(frozen=True)
class RobotModes:
    """Modes of a robot at the degrees of freedom of one recording.

    Parameters
    ----------
    natural : (n_modes,), rad/s
        Natural angular frequencies.
    damping : (n_modes,), 1
        Damping ratios; above 1 where a mode is overdamped.
    shapes : (n_modes, n_places)
        Mass-normalised shapes over ``TIP`` or ``TIP + HOUSING``, kg^-1/2.
    rows, columns
        Places of the recording's responses and excitations among them.
    count
        Number of modes, from the lowest, that may be off.
    """

    natural: Real
    damping: Real
    shapes: Real
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    count: int

    @property
    def per_mode(self) -> int:
        """Number of deviations of one mode: ln frequency, ln damping ratio, each entry of the shape."""
        return 2 + int(self.shapes.shape[1])

    @property
    def size(self) -> int:
        """Number of deviations of all modes that may be off."""
        return self.count * self.per_mode

    def moved(self, u: Real, error: LabError) -> "RobotModes":
        """The modes with deviations from the robot's.

        Parameters
        ----------
        u : (size,)
            Deviations in units of ``error``.
        error
            One standard deviation of the deviations.
        """
        table = u.reshape(self.count, self.per_mode)
        natural, damping, shapes = self.natural.copy(), self.damping.copy(), self.shapes.copy()
        natural[: self.count] *= np.exp(error.frequency * table[:, 0])
        damping[: self.count] *= np.exp(np.clip(error.damping * table[:, 1], -5, 5))
        shapes[: self.count] += self._unit(error)[:, None] * table[:, 2:]
        return RobotModes(natural, damping, shapes, self.rows, self.columns, self.count)

    def aligned(self, reference: "RobotModes") -> "RobotModes":
        """The same modes in the order and on the side of those of a reference.

        Modes may cross when the robot changes, and an eigenvector's sign means nothing: modes are paired so that
        frequencies and shapes (modal assurance criterion, Allemang & Brown 1982) agree best.

        Parameters
        ----------
        reference
            Modes at the same places.
        """
        near = min(self.count + MARGIN, len(self.natural), len(reference.natural))
        mine, theirs = self.shapes[:near], reference.shapes[:near]
        overlap = theirs @ mine.T
        sizes = np.outer(np.sum(theirs**2, axis=1), np.sum(mine**2, axis=1))
        apart = np.log(reference.natural[:near, None] / self.natural[:near]) / PAIRED
        order = scipy.optimize.linear_sum_assignment(apart**2 + 4 * (1 - overlap**2 / np.maximum(sizes, 1e-300)))[1]
        whole = np.concatenate([order, np.arange(near, len(self.natural))])
        signs = np.ones(len(whole))
        signs[:near] = np.where(overlap[np.arange(near), order] < 0, -1.0, 1.0)
        shapes = signs[:, None] * self.shapes[whole]
        return RobotModes(self.natural[whole], self.damping[whole], shapes, self.rows, self.columns, self.count)

    def deviations(self, seen: "RobotModes", error: LabError) -> Real:
        """Deviations u (size,) that move these modes onto those seen, mode by mode.

        Parameters
        ----------
        seen
            Modes at the same places, in any order.
        error
            One standard deviation of each deviation.
        """
        table = np.zeros((self.count, self.per_mode))
        seen = seen.aligned(self)
        first = slice(0, self.count)
        table[:, 0] = np.log(seen.natural[first] / self.natural[first]) / error.frequency
        table[:, 1] = np.log(seen.damping[first] / self.damping[first]) / error.damping
        table[:, 2:] = (seen.shapes[first] - self.shapes[first]) / self._unit(error)[:, None]
        return table.ravel()

    def _unit(self, error: LabError) -> Real:
        return np.asarray(error.shape * np.sqrt(np.mean(self.shapes[: self.count] ** 2, axis=1)))

    def receptance(self, frequencies: Real) -> Complex:
        """``sum phi phi^T / (w_r^2 - w^2 + 2 i zeta_r w_r w)``, overdamped modes exactly, (n, n_rows, n_columns), m/N.

        Parameters
        ----------
        frequencies : (n,), Hz
            Where it is evaluated.
        """
        gain = self._gain(frequencies)
        rows, columns = self.shapes[:, list(self.rows)], self.shapes[:, list(self.columns)]
        pairs = (rows[:, :, None] * columns[:, None, :]).reshape(len(self.natural), -1)
        return np.asarray((gain @ pairs).reshape(len(frequencies), len(self.rows), len(self.columns)))

    def _gain(self, frequencies: Real) -> Complex:
        omega = 2 * np.pi * frequencies[:, None]
        return np.asarray(1 / (self.natural**2 - omega**2 + 2j * self.damping * self.natural * omega))

    def slopes(self, base: "RobotModes", frequencies: Real, force: Complex, error: LabError) -> Complex:
        """Derivative of displacement lines by the deviations u, (n_lines, n_rows, size), m.

        Parameters
        ----------
        base
            The modes at u = 0.
        frequencies : (n_lines,), Hz
            Frequencies of the lines.
        force : (n_lines, n_columns), N
            Force at the lines.
        error
            One standard deviation of each deviation.
        """
        omega = 2 * np.pi * frequencies[:, None]
        gain = self._gain(frequencies)[:, : self.count]
        natural, damping = self.natural[: self.count], self.damping[: self.count]
        rows, columns = self.shapes[: self.count, list(self.rows)], self.shapes[: self.count, list(self.columns)]
        pushed = force @ columns.T
        result = np.zeros((len(frequencies), len(self.rows), self.count, self.per_mode), dtype=complex)
        by_frequency = -(gain**2) * (2 * natural**2 + 2j * damping * natural * omega) * error.frequency
        by_damping = -(gain**2) * 2j * damping * natural * omega * error.damping
        result[:, :, :, 0] = (by_frequency * pushed)[:, None, :] * rows.T
        result[:, :, :, 1] = (by_damping * pushed)[:, None, :] * rows.T
        unit = base._unit(error)
        for entry in range(self.shapes.shape[1]):
            for position, row in enumerate(self.rows):
                if row == entry:
                    result[:, position, :, 2 + entry] += unit * gain * pushed
            for position, column in enumerate(self.columns):
                if column == entry:
                    turned = unit * gain * force[:, position, None]
                    result[:, :, :, 2 + entry] += turned[:, None, :] * rows.T
        return result.reshape(len(frequencies), len(self.rows), self.size)


def robot_modes(robot: SpatialRobot, recording: PosedRecording, offset: Real, sensor: Real, count: int) -> RobotModes:
    """Modes of a robot in a recording's posture.

    Parameters
    ----------
    robot
        The robot, changed or not.
    recording
        Recording with its posture, axes and degrees of freedom.
    offset : (n_moving,), rad
        Angle by which each joint stands elsewhere than stated.
    sensor : (3,), m
        Housing sensor from the tip, in the recording's axes: it moves by ``t + theta x r`` with the node before the
        tool's spring.
    count
        Number of modes, from the lowest, that may be off.
    """
    modes = modes_at(robot, recording.q + offset)
    tip = modes.shapes[:, modes.structure.tip]
    shapes = tip[:, :3] @ recording.axes
    places: tuple[str, ...] = TIP
    if any(label in HOUSING for label in recording.responses):
        moved = modes.shapes[:, housing_node(robot)]
        held = moved[:, :3] @ recording.axes + np.cross(moved[:, 3:] @ recording.axes, sensor)
        shapes = np.hstack([shapes, held])
        places = (*TIP, *HOUSING)
    natural = np.sqrt(modes.squares)
    return RobotModes(
        natural,
        np.diag(damping_of_modes(robot, modes)) / (2 * natural),
        shapes,
        tuple(places.index(label) for label in recording.responses),
        tuple(places.index(label) for label in recording.excitations),
        count,
    )


def predicted_spectrum(modes: RobotModes, spectrum: WindowedSpectrum) -> Complex:
    """Windowed response lines (n_lines, n_responses) that the modes give for the recorded forces.

    Lines above 1.5 times the band are left out: they reach into it by leakage alone.

    Parameters
    ----------
    modes
        Modes in the recording's posture.
    spectrum
        Windowed spectrum of the recording.
    """
    frequencies = spectrum.padded_frequencies
    needed = frequencies <= 1.5 * float(spectrum.frequencies[-1])
    response = np.zeros((len(frequencies), len(modes.rows)), dtype=complex)
    moved = np.einsum("kpq,kq->kp", modes.receptance(frequencies[needed]), spectrum.force_lines[needed])
    response[needed] = moved * spectrum.padded_kinematic[needed]
    return spectrum.cut(spectrum.signal(response))


def quick_spectrum(modes: RobotModes, spectrum: WindowedSpectrum) -> Complex:
    """The same from the windowed forces, line by line: for searches and derivatives, without leakage.

    Parameters
    ----------
    modes
        Modes in the recording's posture.
    spectrum
        Windowed spectrum of the recording.
    """
    moved = np.einsum("kpq,kq->kp", modes.receptance(spectrum.frequencies), spectrum.force_here)
    return np.asarray(moved * spectrum.kinematic)
