"""`millfrf diagnose` writes a page that says where, what and how sure; every physics has a next test of its own."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from scipy.fft import irfft, rfft

from acquisition import Channel, RecordingWriter, StreamDescription
from millfrf.command_line import run
from millfrf.mismatch import library
from millfrf.mismatch.physics.protocol import reported_name
from millfrf.reports.diagnoses.answers import next_test, where
from modal_fit import ModalModel, write_modal_model

RATE, SECONDS, DELAY = 128.0, 40.0, 0.005


@pytest.fixture(scope="module")
def model() -> ModalModel:
    """Two modes at 6 and 14 Hz seen in x and y."""
    omega, zeta = 2 * np.pi * np.array([6.0, 14.0]), np.array([0.03, 0.02])
    shapes = np.array([[1.0, 0.4], [-0.3, 1.0]]).astype(complex)
    return ModalModel(
        quantity="receptance",
        unit="m/N",
        responses=("TCP:+X", "TCP:+Y"),
        excitations=("TCP:+X", "TCP:+Y"),
        poles=omega * (-zeta + 1j * np.sqrt(1 - zeta**2)),
        right=shapes,
        left=shapes / (2j * omega[:, None] * 40.0),
    )


def write_recording(path: Path, model: ModalModel, level: float, seed: int) -> None:
    """Broadband forces through the model; accelerations come 5 ms late; 2 % noise."""
    rng = np.random.default_rng(seed)
    n = int(RATE * SECONDS)
    force = level * rng.normal(size=(n, 2))
    axis = np.arange(n // 2 + 1) * RATE / n
    receptance = model.receptance(np.maximum(axis, 1e-6)) * -((2 * np.pi * axis[:, None, None]) ** 2)
    late = np.exp(-2j * np.pi * axis * DELAY)[:, None]
    response = irfft(late * np.einsum("kpq,kq->kp", receptance, rfft(force, axis=0)), n=n, axis=0)
    response += 0.02 * response.std(axis=0) * rng.normal(size=(n, 2))
    channels = [Channel(f"f{a.lower()}", "force", "N", "TCP", f"+{a}") for a in "XY"]
    channels += [Channel(f"a{a.lower()}", "acceleration", "m/s^2", "TCP", f"+{a}") for a in "XY"]
    stream = StreamDescription("main", RATE, 0.0, tuple(channels))
    with RecordingWriter(path, [stream], event_names=["spindle_speed_rpm"]) as writer:
        writer.append("main", np.hstack([force, response]))
        writer.append_event("spindle_speed_rpm", 0.0, 240.0)


@pytest.mark.long
def test_report_says_what_was_found(tmp_path: Path, model: ModalModel) -> None:
    write_modal_model(tmp_path / "nominal.json", model)
    names = [tmp_path / "weak.h5", tmp_path / "strong.h5"]
    for k, path in enumerate(names):
        write_recording(path, model, 2.0 + 4.0 * k, k)
    out = tmp_path / "out"
    assert run(["diagnose", str(tmp_path / "nominal.json"), *map(str, names), "--out", str(out)]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "The model leaves out channel delay" in page
    for question in ("Where?", "What?", "How sure?", "What else?", "Which test tells?", "two recordings only"):
        assert question in page
    assert page.count("<figure") >= 3
    located = json.loads((out / "diagnosis.json").read_text(encoding="utf-8"))["located"]
    assert [row["channel"] for row in located["channels"] if row["significant"]] == ["ax", "ay"]
    assert located["growth"]["residual"]["exponent"] == pytest.approx(1.0, abs=0.15)
    assert located["spindle_orders_note"]


def test_every_physics_has_its_own_next_test() -> None:
    other = next_test("a physics that somebody adds").test
    named = [
        *map(reported_name, library().values()),
        "none",
        "partly explained",
        "modal_parameters",
        "missing_mode",
        "unmeasured_excitation",
        "clipping",
    ]
    assert [name for name in named if next_test(name).test == other] == []


@pytest.mark.parametrize(
    ("verdict", "says"),
    [
        ("none", "than noise would leave"),
        ("partly explained", "its location is not known"),
        ("unexplained", "its location is not known"),
    ],
)
def test_an_answer_that_is_not_whole_calls_no_place_quiet(verdict: str, says: str) -> None:
    """Noise that is inferred may hold what is unexplained: that no place stands out of it is no news."""
    details = SimpleNamespace(band=SimpleNamespace(sentence="compared from 2 to 50 Hz"))
    diagnosis: Any = SimpleNamespace(verdict=verdict, physics=(), details=details, located={"frequency_bands": []})
    assert says in where(diagnosis)[-1]
