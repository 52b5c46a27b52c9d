"""Every step that takes a file of a recording takes a recording of arrays, with the same answer."""

import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import millfrf as mf
from millfrf.core.results import same_values

RATE = 500.0
CHANNELS = {"fx": "N TCP:+X", "ax": "m/s^2 TCP:+X"}
MODEL = mf.ModalModel(
    np.array([-6.0 + 250.0j]),
    np.array([[1e-2 + 0j]]),
    np.array([[-2e-2j]]),
    ("TCP:+X",),
    ("TCP:+X",),
    band=(10.0, 80.0),
)
CUT = """[cutting]
teeth = 2
diameter_m = 0.0127
ktc_pa = 119e6
krc = 0.17
start_angle_deg = 90.0
exit_angle_deg = 180.0
feed_per_tooth_m = 0.15e-3
"""


def _motion(force: np.ndarray) -> np.ndarray:
    """Acceleration of the model's mode under a force, from rest."""
    length = 2 * len(force)  # the motion dies out in the zeros behind the force
    f = np.fft.rfftfreq(length, 1 / RATE)
    accelerance = -((2 * np.pi * f) ** 2) * MODEL.receptance(f)[:, 0, 0]
    return np.fft.irfft(accelerance * np.fft.rfft(force, length), length)[: len(force)]


def _noise(seed: int) -> mf.Recording:
    force = np.random.default_rng(seed).normal(size=12_000) * 10
    motion = _motion(force) + 1e-3 * np.random.default_rng(seed + 9).normal(size=len(force))
    return mf.Recording.from_arrays({"fx": force, "ax": motion}, RATE, CHANNELS, name=f"noise{seed}")


def _taps() -> mf.Recording:
    force = 0.02 * np.random.default_rng(5).normal(size=10_000)
    for start in range(500, 10_000, 2000):
        force[start : start + 6] += 200 * np.hanning(6)
    return mf.Recording.from_arrays({"fx": force, "ax": _motion(force)}, RATE, CHANNELS, name="taps")


def _cut() -> mf.Recording:
    t = np.arange(10_000) / RATE
    force = 100 + 30 * np.sin(2 * np.pi * 20 * t) + np.random.default_rng(3).normal(size=len(t))
    return mf.Recording.from_arrays({"fx": force, "ax": _motion(force)}, RATE, CHANNELS, name="cut")


def _fast(model: Any, *recordings: Any) -> Any:
    return mf.diagnose(model, *recordings, search_work=1.0)


def _without_path(found: mf.TapResult) -> Any:
    return found.frf, found.settings, found.decay, found.warnings, found.options


STEPS: dict[str, tuple[Callable[[], mf.Recording], Callable[[Any], Any]]] = {
    "estimate": (lambda: _noise(1), lambda one: mf.estimate(one, segment=2.0)),
    "tap": (_taps, lambda one: _without_path(mf.tap(one))),
    "fit": (lambda: _noise(2), lambda one: mf.fit(one, band=(20, 70), modes=1)),
    "chatter": (_cut, lambda one: mf.chatter(one, teeth=2, speed=600.0, responses="ax")),
    "inspect": (_cut, lambda one: mf.inspect(one)),
    "predict": (lambda: _noise(3), lambda one: mf.predict(MODEL, one)),
    "diagnose": (lambda: _noise(4), lambda one: _fast(MODEL, one)),
}


@pytest.fixture(autouse=True)
def _quiet() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.MillfrfWarning)
        yield


@pytest.mark.parametrize("name", STEPS)
def test_a_recording_of_arrays_gives_the_answer_of_its_file(name: str, tmp_path: Path) -> None:
    make, step = STEPS[name]
    recording = make()
    recording.save(tmp_path / recording.path.name)
    of_file = step(tmp_path / recording.path.name)
    assert same_values(step(recording), of_file)


def test_a_step_that_refuses_the_file_refuses_the_recording_in_the_same_words(tmp_path: Path) -> None:
    (tmp_path / "cut.toml").write_text(CUT)
    recording = _cut()
    recording.save(tmp_path / "cut.h5")
    for given in (recording, tmp_path / "cut.h5"):
        with pytest.raises(mf.InputError, match=r"^cut\.h5: forces at TCP:\+X and TCP:\+Y are needed; it has fx"):
            mf.cut_diagnose(tmp_path / "cut.toml", given, depth=1e-3, speed=600.0)


def test_a_step_that_takes_no_recording_says_what_it_is_in_one_line() -> None:
    recording = _noise(1)
    with pytest.raises(mf.InputError, match=r"noise1\.h5 is a file of recording; lobes need a modal model") as refused:
        mf.lobes(recording, "cut.toml")
    assert "\n" not in str(refused.value)


def test_a_written_result_names_the_recording(tmp_path: Path) -> None:
    recording = _noise(1)
    mf.estimate(recording, segment=2.0, out=tmp_path / "frf.h5")
    from millfrf.core.provenance import read_provenance, sha256

    [source] = read_provenance(tmp_path / "frf.h5")["sources"]
    assert source == {"file": "noise1.h5", "sha256": sha256(recording.path)}


def test_a_recording_that_was_closed_is_opened_again() -> None:
    with _noise(1) as recording:
        before = mf.estimate(recording, segment=2.0)
    assert mf.estimate(recording, segment=2.0) == before
    assert mf.inspect(recording).kind == "recording"


def test_a_fit_of_the_recording_finds_the_mode() -> None:
    fitted = mf.fit(_noise(6), band=(20, 70), modes=1)
    np.testing.assert_allclose(fitted.model.natural_frequencies, MODEL.natural_frequencies, rtol=0.01)
