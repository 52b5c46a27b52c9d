"""What is done with causes once they are found: the structure a cut sees, laws with a linear part, sensors missing."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, RecordingWriter, StreamDescription
from estimation import BandRecording, windowed_spectrum
from millfrf.core import InputError
from millfrf.mismatch import (
    Hypothesis,
    JointLaw,
    JointPhysics,
    LabError,
    ModelShape,
    Parameter,
    equivalent_receptance,
    library,
    measured_part,
)
from millfrf.mismatch.joints.joint_axis import JointAxis
from millfrf.mismatch.joints.joint_law import JointMotion
from millfrf.mismatch.models.cause import Cause
from millfrf.mismatch.models.model_terms import with_linear_part
from millfrf.mismatch.records.reading import band_of
from modal_fit import ModalModel

DIRECTION = np.array([0.6, 0.8])
MOTION = JointMotion(1e-4, 1e-2, 1e-3, 0.1, 1e6)


class _Spring:
    """A linear spring and damper as a joint's law."""

    name = "spring"
    equation = "g = k x + c v"
    source = "this test"
    parameters = (Parameter("k", "N/m", 1e3), Parameter("c", "N s/m", 10.0))
    confusable_with = ()

    def starts(self, motion: JointMotion) -> tuple[np.ndarray, ...]:
        return (np.array([1.0, 0.0]),)

    def law(self, values: np.ndarray, motion: JointMotion) -> JointLaw:
        ends = np.array([-1.0, 1.0])
        return JointLaw(
            reach=motion.reach,
            stiffness=values[0] * motion.reach * ends,
            speed=motion.speed,
            damping=values[1] * motion.speed * ends,
        )


@pytest.mark.long
def test_a_linear_joint_is_the_structure_with_its_spring_and_damper(
    small_model: ModalModel, trial_of: Callable[[ModalModel, str, float, int], BandRecording]
) -> None:
    """Exactly ``(I + H K)^-1 H``."""
    lines = windowed_spectrum(trial_of(small_model, "mid", 50.0, 4), band_of(small_model, 128.0), 1.0)
    shape = ModelShape(small_model, LabError())
    k, c = 2e4, 100.0
    cause = Cause(_Spring(), np.array([k, c]), "", JointAxis(DIRECTION), MOTION)
    frequencies = np.linspace(2, 30, 50)
    result = equivalent_receptance(Hypothesis(shape, np.zeros(shape.size), (cause,)), lines, frequencies)
    receptance = small_model.receptance(frequencies)
    added = (k + 2j * np.pi * frequencies * c)[:, None, None] * np.outer(DIRECTION, DIRECTION)
    expected = np.linalg.solve(np.eye(2) + receptance @ added, receptance)
    np.testing.assert_allclose(result.values, expected, atol=1e-3 * np.abs(expected).max())
    assert np.abs(expected - receptance).max() > 0.1 * np.abs(expected).max()


def test_faults_of_the_chain_are_no_part_of_the_structure(
    small_model: ModalModel, trial_of: Callable[[ModalModel, str, float, int], BandRecording]
) -> None:
    lines = windowed_spectrum(trial_of(small_model, "mid", 50.0, 4), band_of(small_model, 128.0), 1.0)
    shape = ModelShape(small_model, LabError())
    gain = library()["gain_error"]
    cause = Cause(gain, np.array([0.5]), gain.places(small_model)[0])
    assert gain.chain(np.array([1j]), cause.values, cause.place, small_model).feedback is None
    frequencies = np.linspace(2, 30, 50)
    result = equivalent_receptance(Hypothesis(shape, np.zeros(shape.size), (cause,)), lines, frequencies)
    np.testing.assert_allclose(result.values, small_model.receptance(frequencies))


@pytest.mark.parametrize("name", [name for name, one in library().items() if isinstance(one, JointPhysics)])
def test_a_law_with_a_linear_part(name: str) -> None:
    """Without numbers it is the law; with them a straight line is added, also beyond the table's end."""
    physics = library()[name]
    plain = Cause(physics, physics.starts(MOTION)[0], "", JointAxis(DIRECTION), MOTION)
    freed = with_linear_part(plain)
    assert freed.size == plain.size + 2
    assert freed.coordinates()[-3:-1].tolist() == [0.0, 0.0]

    def table(law: JointLaw, kind: str) -> np.ndarray:
        values = getattr(law, kind)
        span = law.reach if kind == "stiffness" else law.speed
        axis = np.linspace(-1e-3, 1e-3, 11)
        return np.interp(axis, np.linspace(-span, span, len(values)), values) if len(values) else 0 * axis

    sloped = replace(freed, values=np.append(plain.values, [3e4, 50.0])).law()
    for kind, slope in (("stiffness", 3e4), ("damping", 50.0)):
        step = table(sloped, kind) - table(plain.law(), kind)
        np.testing.assert_allclose(step, slope * np.linspace(-1e-3, 1e-3, 11), atol=1e-3 * slope * 1e-3)


def _recordings(folder: Path, channels: dict[str, tuple[str, str]], rng: np.random.Generator) -> list[Path]:
    """Two files with these channels (quantity and place)."""
    folder.mkdir(exist_ok=True)
    units = {"force": "N", "acceleration": "m/s^2"}
    described = tuple(
        Channel(name, quantity, units[quantity], *place.split(":")) for name, (quantity, place) in channels.items()
    )
    paths = [folder / "low.h5", folder / "high.h5"]
    for path in paths:
        with RecordingWriter(path, [StreamDescription("main", 128.0, 0.0, described)]) as writer:
            writer.append("main", rng.normal(size=(256, len(described))))
    return paths


def test_a_sensor_that_was_not_mounted(small_model: ModalModel, tmp_path: Path) -> None:
    """The model loses that response; without any of its responses nothing can be compared."""
    rng = np.random.default_rng(3)
    channels = {"fx": ("force", "TCP:+X"), "fy": ("force", "TCP:+Y"), "ay": ("acceleration", "TCP:+Y")}
    paths = _recordings(tmp_path, channels, rng)
    part = measured_part(small_model, paths)
    assert part.responses == ("TCP:+Y",)
    frequencies = np.linspace(2, 30, 9)
    np.testing.assert_allclose(part.receptance(frequencies), small_model.receptance(frequencies)[:, 1:])
    forces = {name: place for name, place in channels.items() if name != "ay"}
    with pytest.raises(InputError, match="is in every recording"):
        measured_part(small_model, _recordings(tmp_path / "none", forces, rng))
