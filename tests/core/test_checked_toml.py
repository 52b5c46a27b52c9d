"""A TOML file is read whole into a checked table, or refused in one line that names file, key and value."""

from pathlib import Path

import pytest
from pydantic import BaseModel, ConfigDict

from millfrf.core import InputError, checked_toml


class Table(BaseModel):
    """A table with one number."""

    model_config = ConfigDict(extra="forbid")
    depth_m: float


def test_a_good_file_gives_its_numbers(tmp_path: Path) -> None:
    path = tmp_path / "cut.toml"
    path.write_text("depth_m = 0.001\n", encoding="utf-8")
    assert checked_toml(path, Table, "mapping").depth_m == 0.001


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (None, "cannot read mapping .*cut.toml: No such file or directory; check the name"),
        (b"depth_m = \n", "mapping .*cut.toml is not TOML: .*line 1.*; correct the line"),
        (b"\xff\xfe", "mapping .*cut.toml is not TOML"),
        (b"depht_m = 1.0\n", "mapping .*cut.toml: .*depth_m"),
        (b"depth_m = 'deep'\n", "mapping .*cut.toml: depth_m must be a number, not 'deep'"),
    ],
)
def test_a_bad_file_is_refused_in_one_line(tmp_path: Path, content: bytes | None, said: str) -> None:
    path = tmp_path / "cut.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=said) as refusal:
        checked_toml(path, Table, "mapping")
    assert "\n" not in str(refusal.value)
