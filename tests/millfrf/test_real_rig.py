"""A real 3 x 3 rig of another laboratory through the command line: arrays, recordings, FRF, modes, report."""

import json
from pathlib import Path

import numpy as np
import pytest

from acquisition import Recording
from estimation import read_frf
from millfrf.command_line import run
from modal_fit import ModalModel, compare_modes, read_modal_model

BAND = (500.0, 2900.0)
PERIOD = 8192
MAPPING = Path(__file__).resolve().parents[2] / "examples" / "fsm_mapping.toml"
pytestmark = [pytest.mark.shared_data, pytest.mark.long]


@pytest.fixture(scope="module")
def chain(shared_data: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings, FRFs and models of the two lowest amplitudes, made by the commands."""
    folder = tmp_path_factory.mktemp("fsm")
    source = shared_data / "fsm-cubespec-mimo"
    for level in (100, 200):
        for part in ("train", "test"):
            arrays = str(source / f"u_{level}mV_{part}.npy")
            assert run(["convert", arrays, str(folder / f"{part}{level}.h5"), "--map", str(MAPPING)]) == 0
        recordings = [str(folder / f"train{level}-{n}.h5") for n in range(1, 7)]
        frf, model = str(folder / f"frf{level}.h5"), str(folder / f"model{level}.json")
        settings = ["--segment", "1.28", "--overlap", "0", "--window", "boxcar"]
        assert run(["estimate", *recordings, "--out", frf, *settings]) == 0
        assert run(["fit", frf, "--out", model, "--band", str(BAND[0]), str(BAND[1])]) == 0
    return folder


def explained(model: ModalModel, recording: Path) -> np.ndarray:
    """Share of each response's variance that the model explains in the band, over the last period."""
    with Recording(recording) as opened:
        samples = opened.stream().read()[-PERIOD:]
    lines = np.fft.rfft(samples, axis=0)
    f = np.fft.rfftfreq(PERIOD, 1 / 6400)
    inside = (f >= BAND[0]) & (f <= BAND[1])
    measured = lines[inside, 3:]
    predicted = np.einsum("kpq,kq->kp", model.receptance(f[inside]), lines[inside, :3])
    return np.asarray(1 - np.sum(np.abs(measured - predicted) ** 2, axis=0) / np.sum(np.abs(measured) ** 2, axis=0))


def test_responses_are_coherent_with_the_three_voltages(chain: Path) -> None:
    for level in (100, 200):
        frf = read_frf(chain / f"frf{level}.h5")
        inside = (frf.frequencies >= BAND[0]) & (frf.frequencies <= BAND[1])
        assert frf.valid[inside].all()
        assert frf.multiple_coherence is not None
        assert np.median(frf.multiple_coherence[inside], axis=0).min() > 0.985


def test_model_of_the_train_data_explains_the_test_responses(chain: Path) -> None:
    """At its own amplitude nearly all; at the other one less, because the rig softens with amplitude."""
    models = {level: read_modal_model(chain / f"model{level}.json") for level in (100, 200)}
    own, other = [], []
    for level in (100, 200):
        for number in (1, 2, 3):
            own.append(explained(models[level], chain / f"test{level}-{number}.h5"))
            other.append(explained(models[300 - level], chain / f"test{level}-{number}.h5"))
    assert np.min(own) > 0.99
    assert 0.90 < np.min(other) < np.min(own)


def test_modes_of_the_two_lowest_amplitudes_agree(chain: Path) -> None:
    low, high = (read_modal_model(chain / f"model{level}.json") for level in (100, 200))
    nearest = [int(np.argmin(np.abs(high.poles - pole))) for pole in low.poles]
    assert len(set(nearest)) == len(low.poles) >= 12
    np.testing.assert_allclose(high.natural_frequencies[nearest], low.natural_frequencies, rtol=0.01)
    np.testing.assert_allclose(high.damping_ratios[nearest], low.damping_ratios, rtol=0.25)
    for a, b in zip(low.right, high.right[nearest], strict=True):
        likeness = np.abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real)
        assert likeness > 0.95


def test_fit_says_that_more_than_noise_is_left(chain: Path) -> None:
    stored = json.loads((chain / "model200.json").read_text(encoding="utf-8"))
    assert any("times what the noise explains" in warning for warning in stored["provenance"]["warnings"])


def test_report_runs_on_it(chain: Path) -> None:
    page = chain / "report.html"
    files = [str(chain / name) for name in ("train200-1.h5", "frf200.h5", "model100.json", "model200.json")]
    assert run(["report", *files, "--out", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    for expected in ("638.", "multiple coherence", "Modal model", "MIRROR"):
        assert expected in text
    # the rig softens between the amplitudes by far more than the error bars, and the report says so
    assert "Models compared" in text
    assert "moved by more than three standard errors" in text


def test_frequencies_fall_by_more_than_their_error_bars(chain: Path) -> None:
    low, high = (read_modal_model(chain / f"model{level}.json") for level in (100, 200))
    pairs = compare_modes(low, high)
    assert len(pairs) >= 12
    assert sum(pair.frequency_change < 0 for pair in pairs) >= 12
    assert not any(pair.moved and pair.frequency_change > 0 for pair in pairs)
    assert low.errors is not None
    assert high.errors is not None
    noise = [np.hypot(low.errors.noise[pair.first, 0], high.errors.noise[pair.second, 0]) for pair in pairs]
    fallen = [pair.frequency_change < -3 * bar for pair, bar in zip(pairs, noise, strict=True)]
    assert sum(fallen) >= 10
