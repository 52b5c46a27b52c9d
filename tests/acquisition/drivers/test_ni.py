"""The NI driver on a simulated DAQmx library, through the real nidaqmx package."""

import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition import Recording, aligned_samples, device_summary
from estimation import band_of_channels, cross_spectra, h1, settings_for

RunWithDaqmx = Callable[..., subprocess.CompletedProcess[str]]
COMMON = """
import sys, time
from acquisition import record
from millfrf.core import MillfrfError
from acquisition.drivers.ni_channels import ChannelTable, CounterTable
from acquisition.drivers.ni_source import NiDevice, NiSource

def ni_source(inputs, rate, counters=(), duration=None, **settings):
    device = NiDevice(driver="ni", sample_rate_hz=rate, **settings)
    return NiSource(device, inputs, counters, duration=duration)

def voltage(terminal, name="fx", **settings):
    return ChannelTable(name=name, quantity="force", unit="N", terminal=terminal, units_per_volt=2.0, **settings)

def acceleration(terminal, name="ax", **settings):
    settings = dict(mv_per_unit=10.0, iepe_ma=2.0) | settings
    return ChannelTable(name=name, quantity="acceleration", unit="m/s^2", terminal=terminal, **settings)

def inputs(n):
    hammer = ChannelTable(
        name="fh", quantity="force", unit="N", terminal="cDAQ1Mod1/ai1", mv_per_unit=10.0, iepe_ma=2.0
    )
    return [voltage("cDAQ1Mod9/ai0", node="TCP", direction="+X", range_v=10.0), hammer] + [
        acceleration(f"cDAQ1Mod{k // 4 + 2}/ai{k % 4}", f"a{k}") for k in range(n - 2)
    ]

def attempt(source, path="a.h5", **options):
    try:
        record(source, path, **options)
    except MillfrfError as error:
        print(type(error).__name__, error, getattr(error, "n_missing", ""))
"""


def test_24_channels_come_without_a_gap_at_the_rate_the_device_made(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = COMMON + "attempt(ni_source(inputs(24), 30000.0, duration=1.0))"
    done = with_daqmx(program)
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 0)
    with Recording(tmp_path / "a.h5") as recording:
        stream = recording.stream()
        assert stream.sample_rate == 51200.0  # 13.1072 MHz / 256 / 1
        assert stream.n_samples == 51200
        volts = (np.arange(24) + 1) * np.arange(51200)[:, None] % 65536 / 16384
        expected = volts / ([0.5] + 23 * [0.01])  # each by the sensitivity of its sensor
        np.testing.assert_allclose(stream.read(), expected, rtol=1e-6)
        force, hammer = stream.channels[:2]
        assert (force.full_scale, force.input_delay_s) == (20.0, None)
        assert force.extra["terminal"] == "cDAQ1Mod9/ai0"
        assert hammer.full_scale == pytest.approx(500.0)
        assert hammer.input_delay_s == pytest.approx((40 + 5 / 512) / 51200 + 2.6e-6)
        pairs = recording.clock_pairs("ni")
    slope, _ = np.polyfit(pairs[:, 0], pairs[:, 1], 1)
    assert slope == pytest.approx(1 / 51200, rel=0.02)


def test_what_modules_delay_is_taken_out_when_data_are_used(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    """A force without a filter, one accelerometer as late as an NI-9234 makes it, one whose module mends it itself."""
    program = COMMON + (
        "place = dict(node='TCP', direction='+X')\n"
        "force = voltage('cDAQ1Mod9/ai0', range_v=10.0, **place)\n"
        "motions = [acceleration(f'cDAQ1Mod{m}/ai0', f'a{m}', **place) for m in (2, 8)]\n"
        "attempt(ni_source([force, *motions], 25600.0, duration=1.2), dtype='float64')"
    )
    done = with_daqmx(program, SIM_DAQMX_WAVE="chord")
    assert (done.stdout, done.stderr) == ("", "")
    with Recording(tmp_path / "a.h5") as recording:
        stream = recording.stream()
        delays = [channel.input_delay_s for channel in stream.channels]
        assert delays == [None, pytest.approx((40 + 5 / 512) / 25600 + 2.6e-6), 0.0]
        raw = stream.read()
        np.testing.assert_allclose(raw[:, 2], 50 * raw[:, 0], atol=1e-9)  # V / 0.01 and V / 0.5
        assert np.abs(raw[:, 1] - raw[:, 2]).max() > 100, "the simulated device delays nothing"
        even = aligned_samples(stream, ["fx", "a2", "a8"])
        np.testing.assert_allclose(even[:, 1], even[:, 2], atol=1e-3 * raw[:, 2].std())
        result = h1(cross_spectra(recording, settings_for(25600.0, 0.125, overlap=0.0, window="boxcar")))
        lines = np.arange(8, 480, 8)  # 64 Hz apart, each a whole number of periods in a segment
        np.testing.assert_allclose(result.values[lines, :, 0], 50.0, atol=0.2)
        low = band_of_channels(stream, stream.channels[:1], stream.channels[1:], 2000.0)
        assert np.abs(low.response - 50 * low.force).max() < 1e-3 * raw[:, 2].std()
        assert low.responses[0].input_delay_s is None


def test_an_overrun_says_how_many_samples_are_missing(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = COMMON + (
        "source = ni_source(inputs(2), 25600.0, buffer_s=0.5)\n"
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
        assert recording.ending.startswith("Overrun: cDAQ1Mod9 cDAQ1Mod1: samples were lost")


FAILURES = (
    (-200284, "DeviceTimeout", "no samples came in time; check the sample clock"),
    (-200361, "Overrun", "the device's own memory overflowed; lower the rate"),
    (-200714, "Overrun", "the driver could not fetch them fast enough; lower the rate"),
    (-50405, "Disconnected", "the device is gone; check its plug"),
    (-88705, "Disconnected", "the device is gone; check its plug"),
    (-201003, "Disconnected", "the device is gone; check its plug"),
    (-88710, "Disconnected", "the device is gone"),
    (-50103, "DeviceError", "DAQmx error -50103: The device is not there; look"),
)
"""A code of DAQmx, the error that a lab understands, and its words."""


@pytest.mark.long
def test_a_failing_device_ends_the_recording_in_one_line(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = (
        COMMON
        + f"""
import os
for code in {[code for code, _, _ in FAILURES]}:
    os.environ["SIM_DAQMX_FAIL_CODE"] = str(code)
    attempt(ni_source(inputs(2), 25600.0, timeout_s=0.2), f"{{-code}}.h5")
"""
    )
    done = with_daqmx(program, SIM_DAQMX_FAIL_AT=9000)
    assert done.stderr == ""
    for line, (code, name, words) in zip(done.stdout.splitlines(), FAILURES, strict=True):
        assert line.startswith(name)
        assert words in line
        with Recording(tmp_path / f"{-code}.h5") as recording:
            assert (recording.complete, recording.stream().n_samples) == (False, 7680)
            assert recording.ending.startswith(name)


def test_wrong_terminals_and_a_missing_driver_are_named(with_daqmx: RunWithDaqmx) -> None:
    program = (
        COMMON
        + """
for terminal in ("cDAQ1Mod1/port0", "cDAQ9/ai0"):
    try:
        ni_source([voltage(terminal)], 1000.0)
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


CHANNELS = """
def made(inputs, rate=25600.0, **options):
    try:
        source = ni_source(inputs, rate, **options)
    except MillfrfError as error:
        print(type(error).__name__, error)
    else:
        print(*source.notices, sep="; ")
        return source
"""


def test_what_a_module_was_set_to_is_read_back_and_recorded(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = (
        COMMON
        + CHANNELS
        + (
            "attempt(ni_source([voltage('cDAQ1Mod10/ai0', range_v=0.7, terminal_configuration='rse'),\n"
            "    acceleration('cDAQ1Mod3/ai1', coupling='ac')], 25600.0, duration=0.2))"
        )
    )
    done = with_daqmx(program)
    assert (done.stdout, done.stderr) == ("", "")
    with Recording(tmp_path / "a.h5") as recording:
        force, motion = recording.stream().channels
    assert (force.extra["range_v"], force.extra["terminal_configuration"], force.full_scale) == (1.0, "rse", 2.0)
    assert "coupling" not in force.extra
    assert motion.extra["range_v"] == 5.0
    assert (motion.extra["coupling"], motion.extra["terminal_configuration"]) == ("ac", "pseudodifferential")
    assert motion.extra["iepe_a"] == 0.002
    assert motion.full_scale == pytest.approx(500.0)
    assert motion.extra["device"] == {
        "model": "NI 9234",
        "serial": "01A20067",
        "calibrated": "2026-03-17",
        "chassis": "cDAQ-9178 01A20064",
    }
    assert force.extra["device"]["model"] == "NI 9205"


MISMATCHES = (
    ("made([acceleration('cDAQ1Mod2/ai0')])", {"RANGE": 1}, "channel ax: the input takes 1 V, not 5 V as requested"),
    (
        "made([acceleration('cDAQ1Mod2/ai0', coupling='ac')])",
        {"COUPLING": 10050},
        "coupling is dc, not ac as requested",
    ),
    ("made([voltage('cDAQ1Mod9/ai0', coupling='ac')])", {}, "DAQmx error -200452: Specified property is not suppo"),
    (
        "made([voltage('cDAQ1Mod10/ai0', terminal_configuration='differential')])",
        {"TERMINALS": 10083},
        "terminal configuration is rse, not differential as requested",
    ),
    ("made([acceleration('cDAQ1Mod2/ai0')])", {"EXCITATION": 0.004}, "excitation is 4 mA, not 2 mA as requested"),
    (
        "made([acceleration('cDAQ1Mod9/ai0')])",
        {},
        "the module does not accept these settings (Requested value is not a supported",
    ),
    (
        "made([voltage('cDAQ1Mod2/ai0', range_v=10.0)])",
        {},
        "check range_v, iepe_ma, coupling and terminal_conf",
    ),
    (
        "made([acceleration('cDAQ1Mod2/ai0')], 60000.0)",
        {},
        "sample_rate_hz 60000 is above the device's highest rate, 51200",
    ),
    ("made([acceleration('cDAQ1Mod2/ai0'), voltage('cDAQ2Mod9/ai0')])", {}, "these devices share no clock"),
    ("made([acceleration('cDAQ1Mod2/ai0', teds=True)])", {}, "no readable TEDS (TEDS sensor not detected"),
    ("made([acceleration('cDAQ1Mod7/ai0', teds=True, mv_per_unit=20.0)])", {}, "is another sensor plugged in?"),
    ("made([acceleration('cDAQ1Mod2/ai0')], 20000.0)", {}, "sample rate 20000 Hz requested, 25600 Hz used"),
    ("made([voltage('cDAQ1Mod10/ai0', range_v=0.7)])", {}, "channel fx: range 0.7 V requested, 1 V used"),
    (
        "made([acceleration('cDAQ1Mod2/ai0')], start_trigger='/cDAQ1/ao0')",
        {},
        "DAQmx error -89120: Source terminal to be routed could not be found",
    ),
)
"""A source that is made, what the simulated modules report instead of their settings, and what must be said."""


def test_what_differs_from_the_session_is_one_line_before_the_cut(with_daqmx: RunWithDaqmx) -> None:
    program = COMMON + CHANNELS + "import os\n"
    for call, settings, _ in MISMATCHES:
        names = {f"SIM_DAQMX_{name}": str(value) for name, value in settings.items()}
        program += f"os.environ.update({names})\n{call}\n[os.environ.pop(name) for name in {list(names)}]\n"
    done = with_daqmx(program)
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert len(lines) == len(MISMATCHES)
    for line, (call, _, words) in zip(lines, MISMATCHES, strict=True):
        assert words in line, call


def test_a_sensors_own_data_sheet_scales_where_the_session_gives_none(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = (
        COMMON
        + CHANNELS
        + ("attempt(ni_source([acceleration('cDAQ1Mod7/ai0', teds=True, mv_per_unit=None)], 25600.0, duration=0.2))")
    )
    done = with_daqmx(program)
    assert (done.stdout, done.stderr) == ("", "")
    with Recording(tmp_path / "a.h5") as recording:
        stream = recording.stream()
        volts = np.arange(stream.n_samples) % 65536 / 16384
        np.testing.assert_allclose(stream.read()[:, 0], volts / (0.0987 / 9.80665), rtol=1e-6)
        assert stream.channels[0].sensor == "manufacturer 18 model 3521 version 1 serial 770011"
        assert stream.channels[0].full_scale == pytest.approx(5 / (0.0987 / 9.80665))


def test_ac_coupling_takes_an_offset_out_and_dc_keeps_it(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = (
        COMMON
        + CHANNELS
        + (
            "for name, coupling in (('ac.h5', 'ac'), ('dc.h5', 'dc')):\n"
            "    source = ni_source([acceleration('cDAQ1Mod2/ai0', coupling=coupling)], 25600.0, duration=0.1)\n"
            "    attempt(source, name)"
        )
    )
    done = with_daqmx(program, SIM_DAQMX_OFFSET=0.5, SIM_DAQMX_WAVE="chord")
    assert (done.stdout, done.stderr) == ("", "")
    means = []
    for name in ("ac.h5", "dc.h5"):
        with Recording(tmp_path / name) as recording:
            means.append(recording.stream().read().mean())
    assert means[1] - means[0] == pytest.approx(0.5 / 0.01, rel=1e-6)


@pytest.mark.long
def test_overloads_and_open_loops_are_marked_when_they_come_and_go(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = (
        COMMON
        + CHANNELS
        + ("attempt(ni_source([acceleration('cDAQ1Mod2/ai0', coupling='dc')], 25600.0, duration=3.0))")
    )
    done = with_daqmx(program, SIM_DAQMX_OFFSET=3.0, SIM_DAQMX_OPEN="12800 20480")
    assert (done.stdout, done.stderr) == ("", "")
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.complete
        log = recording.events["devices"]
        story = device_summary(*log.read(), log.read_texts())
        rows = recording.stream().read()[:, 0]
    assert rows.max() == pytest.approx(1.02 * 500)  # the converter's end, not the voltage
    opened, overload = story.losses
    for line, words, begun, lasted in (
        (opened, "channel ax: open current loop", 0.5, 0.3),
        (overload, "channel ax: overload", 32768 / 25600, 32768 / 25600),  # while the ramp is above 2 V
    ):
        assert line.startswith(f"{words} at ")
        at, duration = line.removeprefix(f"{words} at ").removesuffix(" s").split(" s, over after ")
        assert float(at) == pytest.approx(begun, abs=0.15)
        assert float(duration) == pytest.approx(lasted, abs=0.15)


@pytest.mark.long
def test_samples_begin_at_the_trigger_and_a_trigger_that_does_not_come_is_named(
    with_daqmx: RunWithDaqmx, tmp_path: Path
) -> None:
    program = (
        COMMON
        + CHANNELS
        + (
            "trigger = dict(start_trigger='/cDAQ1/PFI0', trigger_timeout_s=1.0)\n"
            "began = time.monotonic()\n"
            "attempt(ni_source([acceleration('cDAQ1Mod2/ai0')], 25600.0, **trigger, duration=0.2, timeout_s=0.1))\n"
            "print(time.monotonic() - began)"
        )
    )
    done = with_daqmx(program, SIM_DAQMX_TRIGGER=0.6)
    assert done.stderr == ""
    assert float(done.stdout) > 0.8
    with Recording(tmp_path / "a.h5") as recording:
        rows = recording.stream().read()[:, 0]
    np.testing.assert_allclose(rows, np.arange(5120) / 16384 / 0.01, rtol=1e-6)
    (tmp_path / "a.h5").unlink()
    late = with_daqmx(program)
    assert late.stdout.startswith("DeviceTimeout cDAQ1Mod2: no edge at the start trigger /cDAQ1/PFI0 for 1")


def test_a_counter_has_a_value_at_each_sample_of_the_inputs(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = (
        COMMON
        + CHANNELS
        + (
            "encoder = CounterTable(name='angle', counter='cDAQ1/_ctr0', pulses_per_revolution=500)\n"
            "edges = CounterTable(name='turns', counter='cDAQ1/_ctr1', kind='edges')\n"
            "source = ni_source([acceleration('cDAQ1Mod2/ai0')], 25600.0, counters=[encoder, edges], duration=1.0)\n"
            "attempt(source, dtype='float64')"
        )
    )
    done = with_daqmx(program)
    assert (done.stdout, done.stderr) == ("", "")
    with Recording(tmp_path / "a.h5") as recording:
        stream = recording.stream()
        assert [channel.name for channel in stream.channels] == ["ax", "angle", "turns"]
        assert stream.channels[1].input_delay_s == 0.0
        rows = stream.read()
    turns = 20.0 * np.arange(25600) / 25600
    assert np.abs(rows[:, 1] - 2 * np.pi * turns).max() <= 2 * np.pi / 2000 + 1e-9
    np.testing.assert_array_equal(rows[:, 2], np.floor(turns))


def test_chassis_that_share_a_reference_clock_are_one_task(with_daqmx: RunWithDaqmx, tmp_path: Path) -> None:
    program = (
        COMMON
        + CHANNELS
        + (
            "clocks = dict(reference_clock='/cDAQ1/PFI1', reference_clock_hz=10e6, sync_pulse='/cDAQ1/PFI2')\n"
            "both = [acceleration('cDAQ1Mod2/ai0'), voltage('cDAQ2Mod9/ai0')]\n"
            "attempt(ni_source(both, 25600.0, **clocks, duration=0.2))"
        )
    )
    done = with_daqmx(program)
    assert (done.stdout, done.stderr) == ("", "")
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.stream().n_samples == 5120
        assert recording.stream().channels[1].extra["device"]["chassis"] == "cDAQ-9178 01A200C8"
