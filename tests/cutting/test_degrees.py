"""`milling_process`: a cut by the keys of a cutting file, and quantities with units."""

import math
from pathlib import Path

import pint
import pytest

from millfrf.core import InputError
from millfrf.cutting import MillingProcess, milling_process, read_cutting_process, write_cutting_process

KEYS = {
    "teeth": 2,
    "diameter_m": 0.0127,
    "ktc_pa": 119e6,
    "krc": 0.17,
    "kac": 0.33,
    "start_angle_deg": 90.0,
    "exit_angle_deg": 180.0,
    "feed_per_tooth_m": 0.15e-3,
    "helix_angle_deg": 30.0,
    "pitch_angles_deg": (170.0, 190.0),
}
RADIANS = MillingProcess(
    2, 0.0127, math.pi / 2, 119e6, 0.17, 0.33, math.pi / 2, math.pi, 0.15e-3, helix_angle=math.pi / 6,
    pitch_angles=(math.radians(170), math.radians(190)),
)  # fmt: skip


def test_degrees_give_the_cut_of_radians_and_of_the_file(tmp_path: Path) -> None:
    process = milling_process(**KEYS)
    assert process == RADIANS
    write_cutting_process(tmp_path / "cut.toml", process)
    assert read_cutting_process(tmp_path / "cut.toml") == process


def test_engagement_by_words_and_the_shape_of_the_cutter() -> None:
    half = {"immersion": "down", "radial_depth_m": 0.00635}
    angles = ("start_angle_deg", "exit_angle_deg", "pitch_angles_deg")
    keys = {key: value for key, value in KEYS.items() if key not in angles}
    process = milling_process(**keys, **half, cutter={"shape": "ball"})
    assert math.degrees(process.start_angle) == pytest.approx(90.0)
    assert process.profile


def test_quantities_are_converted() -> None:
    units = pint.UnitRegistry()
    with_units = {
        "diameter_m": 12.7 * units.mm,
        "ktc_pa": 119 * units.N / units.mm**2,
        "start_angle_deg": math.pi / 2 * units.rad,
        "feed_per_tooth_m": 0.15 * units.mm,
        "pitch_angles_deg": [170, 190] * units.deg,
        "krc": 17 * units.percent,
    }
    process = milling_process(**(KEYS | with_units))
    for name in ("diameter", "ktc", "krc", "start_angle", "feed_per_tooth", "pitch_angles"):
        assert getattr(process, name) == pytest.approx(getattr(RADIANS, name)), name


BAD = {
    "a key": ({"helix_deg": 30.0}, "helix_deg"),
    "a unit": ({"diameter_m": 3 * pint.UnitRegistry().s}, "diameter_m 3 second: give it in m"),
    "no number": ({"diameter_m": "big"}, "diameter_m"),
    "an angle": ({"exit_angle_deg": 200.0}, "immersion 90 to 200 deg is not within"),
    "a helix": ({"helix_angle_deg": 95.0}, "helix angle 95 deg is outside"),
    "a cutter": ({"cutter": 3}, "cutter 3: give a mapping"),
    "none": ({"teeth": None}, "teeth"),
}


@pytest.mark.parametrize("name", BAD)
def test_mistakes_are_one_line_in_the_units_that_were_given(name: str) -> None:
    keys, message = BAD[name]
    with pytest.raises(InputError, match=message) as refused:
        milling_process(**(KEYS | keys))
    assert "\n" not in str(refused.value)


def test_a_type_that_is_no_number_is_refused_in_radians_too() -> None:
    with pytest.raises(InputError, match="diameter 'big': give a number, in m"):
        MillingProcess(2, "big", 1.5, 1e9, 0.3, 0.1, 0.0, 1.0, 1e-4)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="exit_angle None: give a number, in rad"):
        MillingProcess(2, 0.01, 1.5, 1e9, 0.3, 0.1, 0.0, None, 1e-4)  # type: ignore[arg-type]


def test_quantities_are_converted_to_radians_and_degrees_are_recognized() -> None:
    degree = pint.UnitRegistry().degree
    assert MillingProcess(2, 0.01, 90 * degree, 1e9, 0.3, 0.1, 0.0, 180 * degree, 1e-4).exit_angle == pytest.approx(
        math.pi
    )
    with pytest.raises(InputError, match="MillingProcess takes radians, milling_process degrees"):
        MillingProcess(2, 0.01, 1.5, 1e9, 0.3, 0.1, 90.0, 180.0, 1e-4)
