"""Receptance of a robot in a posture, and the recordings with which it is compared."""

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
    """A recording with the stated posture of the robot.

    Parameters
    ----------
    q : (n_moving,), rad
        Stated joint values.
    axes : (3, 3)
        Columns: axes X, Y, Z of the channels in the base frame.
    responses, excitations
        Degrees of freedom of the columns of the recording, at the tip or the housing.
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
    """Return a recording with its posture.

    ``q``: joint values as stated, (n_moving,), rad. ``band``: lowest and highest compared frequency, Hz. ``axes`` (3,
    3): columns X, Y, Z of the channels in the base frame; None: the channels have the axes of the base frame.
    ``decay``: decay rate of the slowest mode, 1/s.
    """
    unknown = [label for label in (*responses, *excitations) if label not in (*TIP, *HOUSING)]
    if unknown or any(label not in TIP for label in excitations):
        raise InputError(
            f"{recording.name}: a robot's model gives motion at {', '.join((*TIP, *HOUSING))} for forces at the tip, "
            f"not at {', '.join(unknown) or 'the housing'}"
        )
    spectrum = windowed_spectrum(recording, band, decay)
    if len(spectrum.frequencies) < 50:
        raise InputError(
            f"{recording.name}: {len(spectrum.frequencies)} lines between {band[0]:g} and {band[1]:g} Hz; "
            "50 are the least: record longer, or widen the band"
        )
    rotation = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    return PosedRecording(np.asarray(q, dtype=float), rotation, tuple(responses), tuple(excitations), spectrum)


def posed_channels(stream: Stream) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the names of the channels for the diagnosis of a robot: forces at the tip, motions at tip or housing."""

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
        The robot's modal model in this posture, with the modes of the band, from which the necessary sampling rate
        follows.
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
    recording_at_tip = read_at(path, excitations, responses, replace(model, band=None), stream=stream)
    decay = float((-model.poles.real).min())
    return posed(recording_at_tip, q, band, responses=responses, excitations=excitations, axes=axes, decay=decay)


def halves(recording: PosedRecording) -> tuple[PosedRecording, PosedRecording]:
    """Return first and second half of a recording, so that one can be held out."""
    recorded, frequencies = recording.spectrum.recording, recording.spectrum.frequencies
    band = (float(frequencies[0]), float(frequencies[-1]))
    middle = len(recorded.force) // 2
    cuts = (("first half", slice(0, middle)), ("second half", slice(middle, None)))
    first, second = (
        posed(
            replace(
                recorded, name=f"{recorded.name}, {name}", force=recorded.force[cut], response=recorded.response[cut]
            ),
            recording.q,
            band,
            responses=recording.responses,
            excitations=recording.excitations,
            axes=recording.axes,
        )
        for name, cut in cuts
    )
    return first, second


MARGIN = 2  # number of further modes that are paired, beyond those that may deviate

PAIRED = 0.1  # difference of ln frequency with the same penalty in pairing as a modal assurance of 0.75


@dataclass(frozen=True)
class RobotModes:
    """Modes of a robot at the degrees of freedom of one recording."""

    natural: Real  # natural angular frequencies, (n_modes,), rad/s
    damping: Real  # damping ratios; above 1 where a mode is overdamped, (n_modes,), 1
    shapes: Real  # mass-normalised shapes over ``TIP`` or ``TIP + HOUSING``, kg^-1/2, (n_modes, n_places)
    # indices of the responses and excitations of the recording among the places of ``shapes``
    rows: tuple[int, ...]
    columns: tuple[int, ...]
    count: int  # number of modes, from the lowest, that may deviate

    @property
    def per_mode(self) -> int:
        """Number of deviations of one mode: ln frequency, ln damping ratio, each entry of the shape."""
        return 2 + int(self.shapes.shape[1])

    @property
    def size(self) -> int:
        """Number of deviations of all modes that may deviate."""
        return self.count * self.per_mode

    def moved(self, u: Real, error: LabError) -> "RobotModes":
        """Return the modes with deviations u.

        ``u``: deviations in units of ``error``, (size,).
        """
        table = u.reshape(self.count, self.per_mode)
        natural, damping, shapes = self.natural.copy(), self.damping.copy(), self.shapes.copy()
        natural[: self.count] *= np.exp(error.frequency * table[:, 0])
        damping[: self.count] *= np.exp(np.clip(error.damping * table[:, 1], -5, 5))
        shapes[: self.count] += self._unit(error)[:, None] * table[:, 2:]
        return RobotModes(natural, damping, shapes, self.rows, self.columns, self.count)

    def aligned(self, reference: "RobotModes") -> "RobotModes":
        """Return the modes in the order and with the signs of ``reference``.

        The order of modes may change with the robot, and the sign of an eigenvector is arbitrary. Modes are paired such
        that frequencies and shapes (modal assurance criterion, Allemang & Brown 1982) agree best.
        """
        paired = min(self.count + MARGIN, len(self.natural), len(reference.natural))
        shapes_near, reference_shapes = self.shapes[:paired], reference.shapes[:paired]
        overlap = reference_shapes @ shapes_near.T
        sizes = np.outer(np.sum(reference_shapes**2, axis=1), np.sum(shapes_near**2, axis=1))
        distance = np.log(reference.natural[:paired, None] / self.natural[:paired]) / PAIRED
        order = scipy.optimize.linear_sum_assignment(distance**2 + 4 * (1 - overlap**2 / np.maximum(sizes, 1e-300)))[1]
        full_order = np.concatenate([order, np.arange(paired, len(self.natural))])
        signs = np.ones(len(full_order))
        signs[:paired] = np.where(overlap[np.arange(paired), order] < 0, -1.0, 1.0)
        shapes = signs[:, None] * self.shapes[full_order]
        return RobotModes(
            self.natural[full_order], self.damping[full_order], shapes, self.rows, self.columns, self.count
        )

    def deviations(self, seen: "RobotModes", error: LabError) -> Real:
        """Return the deviations u (size,), mode by mode, that change these modes into the modes ``seen``."""
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
        """Return ``sum_r phi_r phi_r^T / (w_r^2 - w^2 + 2 i zeta_r w_r w)`` at ``frequencies`` (n,), Hz.

        The shape is (n, n_rows, n_columns), the unit m/N. Overdamped modes are included exactly.
        """
        gain = self._gain(frequencies)
        rows, columns = self.shapes[:, list(self.rows)], self.shapes[:, list(self.columns)]
        pairs = (rows[:, :, None] * columns[:, None, :]).reshape(len(self.natural), -1)
        return np.asarray((gain @ pairs).reshape(len(frequencies), len(self.rows), len(self.columns)))

    def _gain(self, frequencies: Real) -> Complex:
        omega = 2 * np.pi * frequencies[:, None]
        return np.asarray(1 / (self.natural**2 - omega**2 + 2j * self.damping * self.natural * omega))

    def slopes(self, base: "RobotModes", frequencies: Real, force: Complex, error: LabError) -> Complex:
        """Return the derivative of displacement lines by the deviations u, (n_lines, n_rows, size), m.

        ``base`` are the modes at u = 0; ``force`` is (n_lines, n_columns), N.
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
                    scaled_force = unit * gain * force[:, position, None]
                    result[:, :, :, 2 + entry] += scaled_force[:, None, :] * rows.T
        return result.reshape(len(frequencies), len(self.rows), self.size)


def robot_modes(robot: SpatialRobot, recording: PosedRecording, offset: Real, sensor: Real, count: int) -> RobotModes:
    """Return the modes of a robot in the posture of a recording.

    ``offset``: difference of each joint angle from the stated angle, (n_moving,), rad. ``sensor``: position r of the
    housing sensor relative to the tip, in the axes of the recording, (3,), m. The sensor moves by ``t + theta x r``
    with the translation t and rotation theta of the node before the spring of the tool.
    """
    modes = modes_at(robot, recording.q + offset)
    tip = modes.shapes[:, modes.structure.tip]
    shapes = tip[:, :3] @ recording.axes
    places: tuple[str, ...] = TIP
    if any(label in HOUSING for label in recording.responses):
        node_motion = modes.shapes[:, housing_node(robot)]
        sensor_motion = node_motion[:, :3] @ recording.axes + np.cross(node_motion[:, 3:] @ recording.axes, sensor)
        shapes = np.hstack([shapes, sensor_motion])
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
    """Return the windowed response lines (n_lines, n_responses) of the modes to the recorded forces.

    Lines above 1.5 times the upper end of the band are left out, as they affect the band only by leakage.

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
    displacement = np.einsum("kpq,kq->kp", modes.receptance(frequencies[needed]), spectrum.force_lines[needed])
    response[needed] = displacement * spectrum.padded_kinematic[needed]
    return spectrum.cut(spectrum.signal(response))


def quick_spectrum(modes: RobotModes, spectrum: WindowedSpectrum) -> Complex:
    """Return the response lines of :func:`predicted_spectrum` without leakage, computed from the windowed forces.

    They are used for searches and derivatives.
    """
    displacement = np.einsum("kpq,kq->kp", modes.receptance(spectrum.frequencies), spectrum.force_here)
    return np.asarray(displacement * spectrum.kinematic)
