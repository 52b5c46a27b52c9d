"""Units: published factors, refusals, and consistency over prefixes."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import SI_UNITS, DegreeOfFreedom, InputError, si_factor, unit_factor


@pytest.mark.parametrize(
    ("quantity", "unit", "factor"),
    [
        ("force", "lbf", 4.4482216152605),  # NIST SP 811, appendix B
        ("acceleration", "g", 9.80665),  # CGPM 1901
        ("acceleration", "mm/s^2", 1e-3),
        ("displacement", "inch", 0.0254),
        ("displacement", "um", 1e-6),
        ("voltage", "mV", 1e-3),
        ("angular_velocity", "rpm", 0.10471975511965977),
    ],
)
def test_published_factors(quantity: str, unit: str, factor: float) -> None:
    assert si_factor(quantity, unit) == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("unit", ["kg", "furlongish", "", "m/", "degC", "N)", "(N", "N/0", "N N N"])
def test_a_unit_of_another_kind_is_refused_by_name(unit: str) -> None:
    with pytest.raises(InputError, match="not a unit of force"):
        si_factor("force", unit)


@pytest.mark.parametrize("unit", ["m", "furlongish", "", "m/", "m)/N", "(m/N", "m/N/0", "m's/N", "m/N!", "dB"])
def test_what_is_no_such_unit_has_no_factor(unit: str) -> None:
    assert unit_factor(unit, "m/N") is None
    assert unit_factor("mm/kN", "m/N") == pytest.approx(1e-6, rel=1e-12)


@given(st.sampled_from(sorted(SI_UNITS)))
def test_the_si_unit_of_every_quantity_has_factor_one(quantity: str) -> None:
    assert si_factor(quantity, SI_UNITS[quantity]) == 1.0


@given(st.sampled_from(["TCP", "HOUSING", "joint 3"]), st.sampled_from(["+X", "-X", "+Y", "-Z", "+RZ", "+S"]))
def test_degrees_of_freedom_survive_the_round_trip(node: str, direction: str) -> None:
    parsed = DegreeOfFreedom.parse(f"{node}:{direction}")
    assert str(parsed) == f"{node}:{direction}"
    assert parsed.sign == (-1.0 if direction[0] == "-" else 1.0)


@pytest.mark.parametrize("text", ["TCP", "TCP:X", ":+X", "a:b:+X", "TCP:+Q"])
def test_malformed_degrees_of_freedom_are_refused(text: str) -> None:
    with pytest.raises(InputError, match="not understood"):
        DegreeOfFreedom.parse(text)


@pytest.mark.parametrize(
    ("quantity", "unit", "said"),
    [
        ("angular_velocity", "1/min", "write rpm for 1/min"),
        ("angular_velocity", "Hz", "turn/s for Hz"),
        ("angle", "counts", "write rad, deg or turn"),
    ],
)
def test_a_unit_that_leaves_the_angle_open_is_refused(quantity: str, unit: str, said: str) -> None:
    """1/min of a spindle is 2 pi/60 rad/s, not 1/60."""
    with pytest.raises(InputError, match=said):
        si_factor(quantity, unit)


@pytest.mark.parametrize(
    ("quantity", "unit", "factor"),
    [("angular_velocity", "rev/min", np.pi / 30), ("angular_velocity", "turn/s", 2 * np.pi), ("moment", "kNm", 1e3)],
)
def test_units_as_labs_write_them(quantity: str, unit: str, factor: float) -> None:
    assert si_factor(quantity, unit) == pytest.approx(factor, rel=1e-12)
