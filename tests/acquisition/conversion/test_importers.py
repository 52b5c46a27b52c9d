"""WAV, UFF time records and CAN logs become recordings."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

from acquisition import Channel, Recording, RecordingWriter, StreamDescription, convert
from millfrf.command_line import run
from millfrf.core import FileFormatError, InputError

pyuff = pytest.importorskip("pyuff")
MICROPHONE = """
[[channels]]
name = "fx"
quantity = "force"
unit = "N"
node = "TCP"
direction = "+X"
column = 1
sensitivity = 0.01
[[channels]]
name = "ax"
quantity = "acceleration"
unit = "g"
column = 2
"""
DBC = """VERSION ""
BU_: PLC
BO_ 256 Spindle: 8 PLC
 SG_ Speed : 0|16@1+ (0.5,0) [0|32000] "rpm" PLC
"""
LOG_MAP = """
recording = "rec.h5"
dbc = "cell.dbc"
offset_s = 0.25
signals = [{signal = "Speed", series = "spindle_speed_rpm"}]
"""


@pytest.mark.parametrize(("dtype", "largest"), [("int16", 32768), ("int32", 2**31), ("float32", 1), ("uint8", 128)])
def test_wav_becomes_a_recording_at_its_own_rate(tmp_path: Path, dtype: str, largest: int) -> None:
    values = np.random.default_rng(0).uniform(-0.9, 0.9, (500, 2))
    scaled = values * largest + (128 if dtype == "uint8" else 0)
    stored = scaled.astype(dtype) if dtype == "float32" else np.round(scaled).astype(dtype)
    wavfile.write(tmp_path / "a.wav", 48000, stored)
    (tmp_path / "m.toml").write_text(MICROPHONE)
    assert run(["convert", str(tmp_path / "a.wav"), str(tmp_path / "a.h5"), "--map", str(tmp_path / "m.toml")]) == 0
    with Recording(tmp_path / "a.h5") as recording:
        stream = recording.stream()
        assert stream.sample_rate == 48000.0
        expected = values * [100.0, 9.80665]
        tolerance = 1.01 / largest if dtype != "float32" else 1e-6
        assert np.abs((stream.read() - expected) / [100.0, 9.80665]).max() < tolerance


def test_uff_time_records_become_channels(tmp_path: Path) -> None:
    force, motion = np.random.default_rng(1).standard_normal((2, 300))
    file = pyuff.UFF(str(tmp_path / "a.uff"))
    for node, direction, data in ((1, 1, force), (7, -3, motion)):
        axis = {"abscissa_spacing": 1, "abscissa_inc": 1 / 2048, "abscissa_min": 0.0, "x": np.arange(300) / 2048}
        entry = {"type": 58, "func_type": 1, "rsp_node": node, "rsp_dir": direction, "ref_node": 0, "ref_dir": 0}
        names = {"id1": "a", "id2": "b", "id3": "c", "id4": "d", "id5": "e", "binary": 1, "data": data}
        kinds = {"ordinate_spec_data_type": 8, "abscissa_spec_data_type": 17, "orddenom_spec_data_type": 0}
        file.write_sets({**entry, **axis, **names, **kinds, "ord_data_type": 4}, "add")
    (tmp_path / "m.toml").write_text(
        '[[channels]]\nname="fx"\nquantity="force"\nunit="N"\narray="1:+X"\n'
        '[[channels]]\nname="az"\nquantity="acceleration"\nunit="m/s^2"\narray="7:-Z"\n'
    )
    assert run(["convert", str(tmp_path / "a.uff"), str(tmp_path / "a.h5"), "--map", str(tmp_path / "m.toml")]) == 0
    with Recording(tmp_path / "a.h5") as recording:
        assert recording.stream().sample_rate == pytest.approx(2048, rel=1e-5)  # the header keeps six digits
        np.testing.assert_allclose(recording.stream().read(), np.stack([force, motion], 1), rtol=1e-5, atol=1e-5)


def _cell(folder: Path) -> None:
    stream = StreamDescription("main", 100.0, 0.0, (Channel("fx", "force", "N"),))
    with RecordingWriter(folder / "rec.h5", [stream], event_names=["temperature"]) as writer:
        writer.append("main", np.arange(300.0)[:, None])
        writer.append_event("temperature", 1.0, 300.0)
    (folder / "cell.dbc").write_text(DBC)
    (folder / "map.toml").write_text(LOG_MAP)


@pytest.mark.parametrize("suffix", [".blf", ".asc"])
def test_a_can_log_becomes_events_of_its_recording(tmp_path: Path, suffix: str) -> None:
    can = pytest.importorskip("can")
    pytest.importorskip("cantools")
    _cell(tmp_path)
    log = tmp_path / f"log{suffix}"
    with can.Logger(log) as writer:
        for k in range(20):
            data = (2 * (6000 + k)).to_bytes(2, "little") + bytes(6)
            for number, payload in ((256, data), (99, b"\x01")):
                stamp = 1.7e9 + 0.1 * k
                writer(can.Message(stamp, number, is_extended_id=False, data=payload, channel=0))
    out = tmp_path / "with.h5"
    assert run(["convert", str(log), str(out), "--map", str(tmp_path / "map.toml")]) == 0
    with Recording(out) as recording:
        times, speeds = recording.events["spindle_speed_rpm"].read()
        np.testing.assert_allclose(times, 0.25 + 0.1 * np.arange(20), atol=1e-5)
        np.testing.assert_array_equal(speeds, 6000.0 + np.arange(20))
        assert recording.events["temperature"].read()[1].tolist() == [300.0]
        assert recording.stream().n_samples == 300


def test_what_cannot_be_used_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _cell(tmp_path)
    (tmp_path / "m.toml").write_text(MICROPHONE)
    (tmp_path / "a.wav").write_bytes(b"RIFF\x00")
    with pytest.raises(FileFormatError, match=r"cannot be read as .wav"):
        convert(tmp_path / "a.wav", tmp_path / "a.h5", tmp_path / "m.toml")
    (tmp_path / "log.blf").write_bytes(b"LOGG" + bytes(20))
    assert run(["convert", str(tmp_path / "log.blf"), str(tmp_path / "o.h5"), "--map", str(tmp_path / "map.toml")]) == 2
    assert "cannot be read as .blf" in capsys.readouterr().err
    assert run(["convert", str(tmp_path / "log.blf"), str(tmp_path / "o.h5")]) == 2
    assert "needs --map" in capsys.readouterr().err
    (tmp_path / "map.toml").write_text(LOG_MAP.replace("dbc", "dbd", 1))
    assert run(["convert", str(tmp_path / "log.blf"), str(tmp_path / "o.h5"), "--map", str(tmp_path / "map.toml")]) == 2
    assert "map.toml: dbc is missing; add it" in capsys.readouterr().err
    with pytest.raises(InputError):
        convert(tmp_path / "none.uff", tmp_path / "o.h5", tmp_path / "m.toml")
