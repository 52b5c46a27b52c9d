"""The NI driver on a simulated DAQmx library, through the real nidaqmx package."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition import Recording, aligned_samples
from acquisition.drivers.ni import ni_9234_rate
from estimation import band_of_channels, cross_spectra, h1, settings_for

RunWithDaqmx = Callable[..., subprocess.CompletedProcess[str]]
COMMON = """
import sys, time
from acquisition import Channel, record
from foundation import MillfrfError
from acquisition.drivers.ni import NiSource
from acquisition.drivers.ni_channels import NiInput

def inputs(n):
    voltage = NiInput(Channel("fx", "force", "N", "TCP", "+X"), "cDAQ1Mod1/ai0", 0.5, range_volts=10.0)
    hammer = NiInput(Channel("fh", "force", "N"), "cDAQ1Mod1/ai1", 0.01, iepe_current=0.002)
    return [voltage, hammer] + [
        NiInput(Channel(f"a{k}", "acceleration", "m/s^2"), f"cDAQ1Mod{k // 4 + 2}/ai{k % 4}", 0.01, iepe_current=0.002)
        for k in range(n - 2)
    ]

def attempt(source, path="a.h5", **options):
    try:
        record(source, path, **options)
    except MillfrfError as error:
        print(type(error).__name__, error, getattr(error, "n_missing", ""))
"""


def test_24_channels_come_without_a_gap_at_the_rate_the_device_made(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = COMMON + "attempt(NiSource(inputs(24), 30000.0, duration=1.0))"
    done = with_daqmx(program)
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 0)
    with Recording(tmp_path / "a.h5") as recording:
        stream = recording.stream()
        assert stream.sample_rate == 51200.0  # 13.1072 MHz / 256 / 1
        assert stream.n_samples == 51200
        index = np.arange(51200)
        expected = np.stack([(c + 1) * index % 65536 for c in range(24)], axis=1).astype(float)
        expected[:, 0] /= 0.5  # the dynamometer's volts in newtons
        np.testing.assert_array_equal(stream.read(), expected)
        force = stream.channels[0]
        assert force.full_scale == 20.0
        assert force.extra["terminal"] == "cDAQ1Mod1/ai0"
        assert force.input_delay_s == pytest.approx((40 + 5 / 512) / 51200 + 2.6e-6)
        pairs = recording.clock_pairs("ni")
    slope, _ = np.polyfit(pairs[:, 0], pairs[:, 1], 1)
    assert slope == pytest.approx(1 / 51200, rel=0.02)


def test_what_modules_delay_is_taken_out_when_data_are_used(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    """A force without a filter, one accelerometer as late as an NI-9234 makes it, one whose module mends it itself."""
    program = COMMON + (
        "force = NiInput(Channel('fx', 'force', 'N', 'TCP', '+X'), 'cDAQ1Mod9/ai0', 0.5, range_volts=10.0)\n"
        "late, mended = (NiInput(Channel(f'a{m}', 'acceleration', 'm/s^2', 'TCP', '+X'), f'cDAQ1Mod{m}/ai0', 0.01,\n"
        "    iepe_current=0.002) for m in (2, 8))\n"
        "attempt(NiSource([force, late, mended], 25600.0, duration=1.2), dtype='float64')"
    )
    done = with_daqmx(program, SIM_DAQMX_WAVE="chord")
    assert (done.stdout, done.stderr) == ("", "")
    with Recording(tmp_path / "a.h5") as recording:
        stream = recording.stream()
        delays = [channel.input_delay_s for channel in stream.channels]
        assert delays == [None, pytest.approx((40 + 5 / 512) / 25600 + 2.6e-6), 0.0]
        raw = stream.read()
        np.testing.assert_allclose(raw[:, 2], 0.5 * raw[:, 0], atol=1e-9)
        assert np.abs(raw[:, 1] - raw[:, 2]).max() > 10, "the simulated device delays nothing"
        even = aligned_samples(stream, ["fx", "a2", "a8"])
        np.testing.assert_allclose(even[:, 1], even[:, 2], atol=1e-3 * raw[:, 2].std())
        found = h1(cross_spectra(recording, settings_for(25600.0, 0.125, overlap=0.0, window="boxcar")))
        lines = np.arange(8, 480, 8)  # 64 Hz apart, each a whole number of periods in a segment
        np.testing.assert_allclose(found.values[lines, :, 0], 0.5, atol=2e-3)
        low = band_of_channels(stream, stream.channels[:1], stream.channels[1:], 2000.0)
        assert np.abs(low.response - 0.5 * low.force).max() < 1e-3 * raw[:, 2].std()
        assert low.responses[0].input_delay_s is None


def test_an_overrun_says_how_many_samples_are_missing(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = COMMON + (
        "source = NiSource(inputs(2), 25600.0, buffer_duration=0.5)\n"
        "attempt(source, observer=lambda block: time.sleep(1.0) if block.first_sample == 2560 else None)"
    )
    done = with_daqmx(program)
    assert done.stderr == ""
    name, *words = done.stdout.split()
    assert name == "Overrun"
    assert "missing after sample 5120" in done.stdout
    assert int(words[-1]) == pytest.approx(0.5 * 25600, rel=0.2)
    with Recording(tmp_path / "a.h5") as recording:
        assert (recording.complete, recording.stream().n_samples) == (False, 5120)
        assert recording.ending.startswith("Overrun: cDAQ1Mod1: samples were lost")


@pytest.mark.parametrize(
    ("code", "name", "words"),
    [
        (-200284, "DeviceTimeout", "no samples came in time; check the sample clock"),
        (-201003, "Disconnected", "the device is gone; check its plug"),
        (-88710, "Disconnected", "the device is gone"),
        (-50103, "DeviceError", "DAQmx error -50103: The device is not there; look"),
    ],
)
def test_a_failing_device_ends_the_recording_in_one_line(
    with_daqmx: RunWithDaqmx, tmp_path: Path, code: int, name: str, words: str
) -> None:
    program = COMMON + "attempt(NiSource(inputs(2), 25600.0, timeout=0.2))"
    done = with_daqmx(program, SIM_DAQMX_FAIL_AT=9000, SIM_DAQMX_FAIL_CODE=code)
    assert done.stderr == ""
    assert done.stdout.startswith(name)
    assert words in done.stdout
    assert done.stdout.count("\n") == 1
    with Recording(tmp_path / "a.h5") as recording:
        assert (recording.complete, recording.stream().n_samples) == (False, 7680)
        assert recording.ending.startswith(name)


def test_wrong_terminals_and_a_missing_driver_are_named(with_daqmx: RunWithDaqmx) -> None:
    program = (
        COMMON
        + """
for terminal in ("cDAQ1Mod1/port0", "cDAQ9/ai0"):
    try:
        NiSource([NiInput(Channel("fx", "force", "N"), terminal, 0.5)], 1000.0)
    except MillfrfError as error:
        print(error)
"""
    )
    done = with_daqmx(program)
    assert done.stderr == ""
    first, second = done.stdout.splitlines()
    assert "a terminal does not exist" in first
    assert "cDAQ9: the device is gone" in second
    missing = with_daqmx("import os; os.environ['LD_LIBRARY_PATH'] = ''\n" + program)
    assert "install NI-DAQmx from ni.com" in missing.stdout


@pytest.mark.parametrize(("wanted", "made"), [(51200.0, 51200.0), (50000.0, 51200.0), (20000.0, 25600.0), (1.0, None)])
def test_rates_of_the_9234(wanted: float, made: float | None) -> None:
    assert ni_9234_rate(wanted) == (made or 51200 / 31)
