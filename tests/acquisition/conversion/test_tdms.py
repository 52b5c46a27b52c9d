"""TDMS files become recordings by a mapping."""

from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter

from acquisition import Recording, convert
from millfrf.core import FileFormatError

MAPPING = """sample_rate = 1024.0
[[channels]]
name = "fx"
array = "Analog/Force"
quantity = "force"
unit = "kN"
node = "TCP"
direction = "+X"
[[channels]]
name = "ax"
array = "Analog/Acceleration"
quantity = "acceleration"
unit = "g"
node = "TCP"
direction = "+X"
"""


def test_channels_by_group_and_name_in_si(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    force, motion = rng.standard_normal((2, 3000))
    with TdmsWriter(tmp_path / "cut.tdms") as writer:
        for part in (slice(0, 1000), slice(1000, None)):  # several segments, as a running acquisition writes them
            writer.write_segment(
                [ChannelObject("Analog", "Force", force[part]), ChannelObject("Analog", "Acceleration", motion[part])]
            )
    (tmp_path / "map.toml").write_text(MAPPING, encoding="utf-8")
    convert(tmp_path / "cut.tdms", tmp_path / "cut.h5", tmp_path / "map.toml")
    with Recording(tmp_path / "cut.h5") as recording:
        samples = recording.stream().read()
        assert recording.stream().sample_rate == 1024.0
    np.testing.assert_allclose(samples[:, 0], 1e3 * force, rtol=1e-6)
    np.testing.assert_allclose(samples[:, 1], 9.80665 * motion, rtol=1e-6)


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bad.tdms").write_bytes(b"TDSm" + bytes(range(200)))
    (tmp_path / "map.toml").write_text(MAPPING, encoding="utf-8")
    with pytest.raises(FileFormatError, match=r"bad\.tdms"):
        convert(tmp_path / "bad.tdms", tmp_path / "out.h5", tmp_path / "map.toml")
    assert not (tmp_path / "out.h5").exists()
