"""Session files: what is understood, and what is said of mistakes."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import Session, build_source, session_from_text, session_text
from millfrf.core import InputError, MillfrfError


def read_session(path: Path) -> Session:
    return session_from_text(session_text(path), str(path))


GOOD = """
title = "Sweep 1"
duration_s = 2.0
band_hz = [10.0, 400.0]
[tool]
teeth = 2
[pose]
joints_deg = [0, -90, 90, 0, 45, 0]
[device]
driver = "ni"
sample_rate_hz = 51200
[[channels]]
name = "fx"
quantity = "force"
unit = "kN"
node = "TCP"
direction = "+X"
terminal = "cDAQ1Mod1/ai0"
amplifier = "COM7"
amplifier_range = 1
range_v = 10
[[channels]]
name = "ax"
quantity = "acceleration"
unit = "g"
terminal = "cDAQ1Mod2/ai0"
mv_per_unit = 100
iepe_ma = 2
[[can]]
interface = "virtual"
channel = "c"
dbc = "cell.dbc"
signals = [{signal = "Speed", series = "spindle_speed_rpm"}]
[[tachometer]]
port = "COM9"
baud = 9600
series = "rpm"
[[modbus]]
port = "COM8"
baud = 19200
slave = 3
registers = [{address = 7, series = "load"}]
[[amplifier]]
port = "COM7"
baud = 9600
on_open = [{send = "RANGE {fx}", expect = "OK"}]
"""


def test_units_become_si_at_this_edge() -> None:
    session = session_from_text(GOOD)
    force, acceleration = session.channels
    assert force.sensitivity == pytest.approx(10 / 1000)  # 1 kN at 10 V
    assert (force.channel().unit, force.channel().degree_of_freedom) == ("N", "TCP:+X")
    assert acceleration.sensitivity == pytest.approx(0.1 / 9.80665)
    assert acceleration.iepe_current == 0.002
    assert [len(tables) for tables in (session.amplifier, session.can, session.tachometer, session.modbus)] == [
        1,
        1,
        1,
        1,
    ]


def test_a_charge_range_in_picocoulombs_scales_by_the_sensors_sheet() -> None:
    text = GOOD.replace("amplifier_range = 1\n", "amplifier_range = 5000\namplifier_volts = 5\npc_per_unit = -7500\n")
    session = session_from_text(text)
    force = session.channels[0]
    assert force.sensitivity == pytest.approx(5 * -7.5 / 5000)  # 5 V at 5000 pC, -7.5 pC/N
    assert force.channel().extra == {
        "amplifier": "COM7",
        "amplifier_range": 5000.0,
        "amplifier_volts": 5.0,
        "pc_per_unit": -7500.0,
    }
    assert session.ranges_of(session.amplifier[0]) == {"fx": 5000.0}


def test_the_example_is_a_session() -> None:
    session = read_session(Path(__file__).parents[2] / "examples" / "session.toml")
    assert [channel.name for channel in session.channels] == ["fx", "ax", "tacho"]
    assert (len(session.amplifier), len(session.can)) == (1, 1)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mv_per_unit", "mv_per_units", r"channels\[2\].mv_per_units is not a known key; did you mean mv_per_unit\?"),
        ("title", "titel", "titel is not a known key; did you mean title"),
        ("= 51200", "= 900", "sample_rate_hz 900 is too low for band_hz up to 400 Hz; sample at 1024 Hz or more"),
        ('unit = "g"', 'unit = "kN"', r"channels\[2\]: unit 'kN' is not a unit of acceleration; use m/s\^2"),
        ('"fx"', '"ax"', "channel name ax appears twice"),
        ('"cDAQ1Mod1/ai0"', '"cDAQ1Mod2/ai0"', "terminal cDAQ1Mod2/ai0 appears twice"),
        ("range_v = 10", "range_v = -3", r"channels\[1\].range_v must be above 0, not -3"),
        ('driver = "ni"', 'driver = "nj"', "device.driver is not known; use ni, replay or simulated"),
        ('driver = "ni"', "", "device.driver is missing"),
        ('quantity = "force"', 'quantity = "forc"', "unknown quantity 'forc'; use one of force"),
        ("duration_s = 2.0", 'duration_s = "x"', "duration_s must be a number, not 'x'"),
        ("mv_per_unit = 100", "mv_per_unit = 0", "channel ax: a sensitivity of 0; take it from the calibration sheet"),
        ("mv_per_unit = 100", "", "give either mv_per_unit .* or units_per_volt .* or amplifier_range"),
        ("amplifier_range = 1", "units_per_volt = 0.1", "amplifier and pc_per_unit go with amplifier_range"),
        ("RANGE {fx}", "RANGE 1", "amplifier COM7 does not receive the range of channel fx; write {fx} for it"),
        ("RANGE {fx}", "RANGE {fy}", "{fy} is the range of no channel; give the channel fy amplifier = 'COM7'"),
        ('amplifier = "COM7"', "", "{fx} is the range of no channel"),
        ('amplifier = "COM7"', 'amplifier = "COM6"', r"channel fx: no \[\[amplifier\]\] 'COM6'; there are COM7"),
        ("baud = 19200", "", "modbus on COM8: baud is missing"),
        ("baud = 19200", 'host = "10.0.0.2"', "give either port and baud .* or host"),
        ("slave = 3", 'slave = 3\nparity = "mark"', "parity"),
        ("iepe_ma = 2", "iepe_ma = 2000", "iepe_ma must be 20 or less, not 2000"),
        ('"+X"', '"X"', "TCP:X is not understood"),
        ("[10.0, 400.0]", "[400.0, 10.0]", "is empty; give the lower frequency first"),
        ("slave = 3", "slave = 300", r"modbus\[1\].slave must be 247 or less, not 300"),
        ("[device]", "[device", "is not TOML"),
    ],
)
def test_mistakes_are_said_in_one_line(old: str, new: str, words: str) -> None:
    assert old in GOOD
    with pytest.raises(InputError, match=words) as caught:
        session_from_text(GOOD.replace(old, new), "S.toml")
    assert str(caught.value).startswith("S.toml")
    assert "\n" not in str(caught.value)


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no session file"):
        read_session(tmp_path / "none.toml")
    (tmp_path / "a.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="UTF-8"):
        read_session(tmp_path / "a.toml")
    (tmp_path / "b.toml").write_text("[device]\ndriver = 'replay'\nfile = 'none.h5'\n")
    with pytest.raises(InputError, match="no file"):
        build_source(read_session(tmp_path / "b.toml"), "", tmp_path)


def _said_of(text: str) -> str:
    try:
        session_from_text(text)
    except MillfrfError as error:
        return str(error)
    return ""


@given(text=st.text(max_size=200))
def test_any_text_is_understood_or_refused(text: str) -> None:
    assert "\n" not in _said_of(text)


@given(cut=st.integers(0, len(GOOD)), at=st.integers(0, len(GOOD) - 1), to=st.characters(codec="utf-8"))
def test_a_damaged_session_is_understood_or_refused(cut: int, at: int, to: str) -> None:
    for text in (GOOD[:cut], GOOD[:at] + to + GOOD[at + 1 :]):
        assert "\n" not in _said_of(text)
