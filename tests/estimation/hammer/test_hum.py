"""Hum in tap tests: it was there before the taps, is no ringing, and asks for no window."""

from pathlib import Path

import numpy as np
import pytest
from simulated_taps import Bench, Hits, Structure, frf_of, plate, write_taps

from acquisition import Recording, RecordingWriter, StreamDescription
from estimation import response_decay

DIED = (0.05, 0.04, 0.03, 0.03)  # damping with which every response dies out in a segment
RINGS = (0.002, 0.04, 0.03, 0.03)


@pytest.mark.parametrize("hum", [0.01, 0.1])
@pytest.mark.parametrize(
    ("files", "seconds"),
    [
        ([(0.15,)], 2.0),  # a single tap, soon after the recording begins
        ([(0.13,), (0.17,), (0.11,)], 2.0),  # one tap a file
        ([(0.2, 1.7, 3.2, 4.7)], 6.2),  # taps in step with the hum, which is then coherent with the force
    ],
)
def test_hum_is_no_ringing(tmp_path: Path, files: list[tuple[float, ...]], seconds: float, hum: float) -> None:
    """Before: 73 % of the response "still rings", and a window of 0.24 s."""
    for damping in (DIED, RINGS):
        structure = plate(damping=damping)
        paths = [
            write_taps(
                tmp_path / f"{damping[0]}_{k}.h5",
                structure,
                Hits(times, at="P1:+Z"),
                ("P1:+Z",),
                Bench(rate=2560.0, seconds=seconds, hum=hum, seed=k),
            )
            for k, times in enumerate(files)
        ]
        _, result, settings = frf_of(paths)
        decay = response_decay(result, settings)
        assert np.abs(np.array(decay.hum) - 50.0).min() < 1.0
        if damping is DIED:
            assert decay.left == 0.0
            assert settings.time_constant is None
        else:  # a mode that does ring is still found, beside the hum
            assert abs(decay.frequency - structure.frequencies[0]) < 1.0
            assert decay.left > 0.1


def test_without_hum_none_is_reported(tmp_path: Path) -> None:
    path = write_taps(
        tmp_path / "a.h5", plate(damping=RINGS), Hits((0.15,), at="P1:+Z"), ("P1:+Z",), Bench(rate=2560.0, seconds=2.0)
    )
    _, result, settings = frf_of([path])
    assert response_decay(result, settings).hum == ()


@pytest.mark.parametrize("hum", [0.003, 0.1])
def test_hum_is_subtracted(tmp_path: Path, hum: float) -> None:
    """What remains of the hum is below the noise of the FRF; before: a fit had a mode at 50 Hz with 0.0003 %."""
    structure, hits = plate(damping=DIED), Hits((0.5, 2.13, 3.79, 5.41), at="P1:+Z")
    values, frequencies = [], np.empty(0)
    for size in (0.0, hum):
        bench = Bench(rate=2560.0, seconds=7.0, hum=size, noise=1e-4, seed=3)
        merged, result, _ = frf_of(
            [write_taps(tmp_path / f"{size}.h5", structure, hits, ("P1:+Z",), bench)], subtract_hum=True
        )
        values.append(merged.frf.values[:, 0, 0])
        frequencies = merged.frf.frequencies
    (tone,) = result[0].tones
    assert tone.frequency == pytest.approx(50, abs=1e-3)
    assert tone.amplitudes[0] == 0  # the force
    near = np.abs(frequencies - 50) < 5
    truth = structure.frf(2j * np.pi * frequencies, "P1:+Z", "P1:+Z", 2)
    remaining, noise = (np.sqrt(np.mean(np.abs(values[0] - other)[near] ** 2)) for other in (values[1], truth))
    assert remaining < noise


def test_both_mains_and_a_harmonic_are_found_with_their_phases(tmp_path: Path) -> None:
    """A strong tone does not appear on another line, and each is in the channel that contains it."""
    plain = write_taps(tmp_path / "a.h5", plate(damping=DIED), Hits((0.5, 2.13, 3.79)), ("P1:+Z", "P2:+Z"))
    tones = {49.93: (1, 3.0 + 2.0j), 60.02: (2, 0.2j), 99.86: (1, -0.3 + 0.1j)}
    with Recording(plain) as recording:
        source = recording.stream()
        samples, description = source.read(), StreamDescription("main", source.sample_rate, 0.0, source.channels)
    time = np.arange(len(samples)) / description.sample_rate
    for frequency, (column, amplitude) in tones.items():
        samples[:, column] += (amplitude * np.exp(2j * np.pi * frequency * time)).real
    with RecordingWriter(tmp_path / "b.h5", [description]) as writer:
        writer.append("main", samples)
    assert frf_of([plain], subtract_hum=True)[1][0].tones == ()
    subtracted = frf_of([tmp_path / "b.h5"], subtract_hum=True)[1][0].tones
    assert [tone.frequency for tone in subtracted] == pytest.approx(list(tones), abs=2e-3)
    for tone, (column, amplitude) in zip(subtracted, tones.values(), strict=True):
        expected = np.zeros(3, complex)
        expected[column] = amplitude
        assert tone.amplitudes == pytest.approx(expected, abs=0.05 * abs(amplitude) + 0.01)


@pytest.mark.parametrize("damping", [1e-4, 1e-3])
def test_a_mode_at_the_mains_is_no_hum(tmp_path: Path, damping: float) -> None:
    """Taps in step with a mode at 50 Hz give it one phase all along, but the silence before them does not show it."""
    structure = Structure(np.array([50.0]), np.array([damping]), {"P1:+Z": np.array([1.0])})
    bench = Bench(rate=2560.0, seconds=6.2, noise=1e-4)
    path = write_taps(tmp_path / "a.h5", structure, Hits((0.5, 2.0, 3.5, 5.0), spread=0.0), ("P1:+Z",), bench)
    assert frf_of([path], subtract_hum=True)[1][0].tones == ()
