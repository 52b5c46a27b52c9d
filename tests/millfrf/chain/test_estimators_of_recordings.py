"""`millfrf estimate --estimator`: instruments against feedback, local polynomials on short records; known truth."""

from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from acquisition import Channel, RecordingWriter, StreamDescription
from estimation import read_frf
from millfrf.command_line import run
from millfrf.core import InputError
from millfrf.steps.estimate import estimate
from modal_fit import ModalModel

RATE = 200.0
PLANT = (np.array([0.0, 2e-7]), np.array([1.0, -0.8]))
FEEDBACK = -0.8e6
"""N/m: the cut answers a deflection with a force."""


def write(path: Path, channels: tuple[Channel, ...], columns: list[np.ndarray], rate: float = RATE) -> str:
    with RecordingWriter(path, (StreamDescription("main", rate, 0.0, channels),)) as writer:
        writer.append("main", np.column_stack(columns))
    return str(path)


@pytest.fixture(scope="module")
def with_feedback(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Force = command + feedback of the motion; a disturbance that nobody measures moves the structure too."""
    rng = np.random.default_rng(8)
    command, disturbance = rng.standard_normal((2, 300_000))
    b, a = PLANT
    closed = a - FEEDBACK * b
    x = signal.lfilter(b, closed, command) + signal.lfilter(1e-6 * a, closed, disturbance)
    force = command + FEEDBACK * x
    channels = (
        Channel("f", "force", "N", "TCP", "+X"),
        Channel("u", "displacement", "m", "TCP", "+X"),
        Channel("command", "voltage", "V", "DRIVE", "+X"),
    )
    return write(tmp_path_factory.mktemp("feedback") / "rec.h5", channels, [force, x, command])


def off(path: Path) -> float:
    frf = read_frf(path)
    inside = (frf.frequencies > 5) & (frf.frequencies < 80)
    truth = signal.freqz(*PLANT, frf.frequencies, fs=RATE)[1][inside]
    return float(np.abs(np.mean(frf.values[inside, 0, 0] / truth) - 1))


def test_an_instrument_takes_out_what_feedback_does_to_h1(with_feedback: str, tmp_path: Path) -> None:
    common = [with_feedback, "--excitation", "f", "--response", "u", "--segment", "2", "--band", "1", "90"]
    assert run(["estimate", *common, "--out", str(tmp_path / "h1.h5")]) == 0
    instrumental = ["--estimator", "instrumental-variable", "--instrument", "command"]
    assert run(["estimate", *common, *instrumental, "--out", str(tmp_path / "iv.h5")]) == 0
    assert off(tmp_path / "h1.h5") > 0.3
    assert off(tmp_path / "iv.h5") < 0.03
    frf = read_frf(tmp_path / "iv.h5")
    assert (frf.responses, frf.excitations, frf.quantity) == (("TCP:+X",), ("TCP:+X",), "receptance")
    assert frf.covariance is not None
    assert run(["report", str(tmp_path / "iv.h5"), with_feedback, "--out", str(tmp_path / "r.html")]) == 0


def test_channels_are_chosen_by_quantity_beside_the_instrument(with_feedback: str) -> None:
    made = estimate(
        with_feedback, segment=2.0, band=(1.0, 90.0), estimator="instrumental-variable", instruments="command"
    )
    assert made.frf.excitations == ("TCP:+X",)
    assert made.tests[0].excitations[0].name == "f"


def modes() -> ModalModel:
    omega, zeta = 2 * np.pi * np.array([17.0, 18.5]), np.array([0.03, 0.1])
    dofs = ("TCP:+X", "TCP:+Y")
    right, left = np.array([[1.0, 0.3], [-0.4, 1.0]]) + 0j, np.array([[1.0, -0.2], [0.5, 1.0]]) * -1j
    return ModalModel(omega * (-zeta + 1j * np.sqrt(1 - zeta**2)), right, left, dofs, dofs)


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Two records of 16 s, forces random since long before: full leakage, 1 % noise."""
    folder, paths, rate, before, n = tmp_path_factory.mktemp("short"), [], 100.0, 1000, 1600
    rng = np.random.default_rng(3)
    channels = tuple(Channel(f"f{a}", "force", "N", "TCP", f"+{a.upper()}") for a in "xy")
    channels += tuple(Channel(f"u{a}", "displacement", "m", "TCP", f"+{a.upper()}") for a in "xy")
    response = modes().receptance(np.fft.rfftfreq(2 * (n + before), 1 / rate))
    for number in range(2):
        force = rng.standard_normal((2 * (n + before), 2))
        x = np.fft.irfft(np.einsum("kpq,kq->kp", response, np.fft.rfft(force, axis=0)), len(force), axis=0)
        x = x + 0.01 * x.std(axis=0) * rng.standard_normal(x.shape)
        part = slice(before, before + n)
        paths.append(write(folder / f"{number}.h5", channels, [force[part], x[part]], rate))
    return paths


@pytest.mark.long
def test_local_polynomials_see_short_records_without_leakage(short: list[str], tmp_path: Path) -> None:
    band, out = ["--band", "14", "23"], tmp_path / "frf.h5"
    assert run(["estimate", *short, *band, "--estimator", "local-polynomial", "--out", str(out)]) == 0
    local = read_frf(out)
    assert local.covariance is not None
    assert local.frequencies[1] - local.frequencies[0] == pytest.approx(1 / 16, rel=0.01)

    def error(frf: object) -> np.ndarray:
        inside = (frf.frequencies >= 14) & (frf.frequencies <= 23) & frf.valid  # type: ignore[attr-defined]
        truth = modes().receptance(frf.frequencies[inside])  # type: ignore[attr-defined]
        return np.abs(frf.values[inside] - truth)  # type: ignore[attr-defined]

    best = []
    for segment in ("2", "4", "8"):
        assert run(["estimate", *short, "--segment", segment, *band, "--force", "--out", str(tmp_path / "h1.h5")]) == 0
        best.append(np.sqrt(np.mean(error(read_frf(tmp_path / "h1.h5")) ** 2)))
    assert np.sqrt(np.mean(error(local) ** 2)) < 0.3 * min(best)
    normalised = np.mean(error(local) ** 2 / local.covariance.variance())
    assert 0.6 < normalised < 1.6
    page = tmp_path / "r.html"
    assert run(["report", str(out), *short, "--out", str(page)]) == 0
    assert "local polynomials" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"estimator": "local-polynomial"}, "state the band, --band LO HI"),
        ({"estimator": "local-polynomial", "band": (5.0, 20.0), "exclude": True}, "no segments to leave out"),
        ({"estimator": "local-polynomial", "band": (5.0, 20.0), "stack": "side-by-side"}, "use --stack sum"),
        ({"estimator": "instrumental-variable"}, "needs instruments"),
        ({"estimator": "instrumental-variable", "instruments": ("none",)}, "none"),
        ({"estimator": "instrumental-variable", "instruments": ("f", "command")}, "no channel excites beside"),
        ({"instruments": ("command",)}, "not for h1"),
    ],
)
def test_options_that_do_not_fit_are_refused(with_feedback: str, options: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        estimate(with_feedback, segment=2.0, **options)
