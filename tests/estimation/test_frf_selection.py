"""`Frf.sel`: entries by their names and lines by a band, as an FRF."""

import re

import numpy as np
import pytest

from estimation import Frf, FrfCovariance
from millfrf.core import InputError

RESPONSES, EXCITATIONS = ("TCP:+X", "TCP:+Y", "HOUSING:+X"), ("TCP:+X", "TCP:+Y")
F = np.linspace(0.0, 100.0, 101)


def _frf() -> Frf:
    rng = np.random.default_rng(2)
    shape = (len(F), 3, 2)
    rows, columns = rng.normal(size=(len(F), 3, 3)), rng.normal(size=(len(F), 2, 2))
    covariance = FrfCovariance(rows @ rows.transpose(0, 2, 1) + 0j, columns @ columns.transpose(0, 2, 1) + 0j)
    return Frf(
        F, rng.normal(size=shape) + 1j * rng.normal(size=shape), RESPONSES, EXCITATIONS, "receptance", "m/N", F > 3,
        multiple_coherence=rng.uniform(size=shape[:2]), covariance=covariance, band=(10.0, 60.0),
        coherence=rng.uniform(size=shape), averages=np.arange(1, 7).reshape(3, 2),
        common_errors=rng.normal(size=(4, *shape)) + 0j,
    )  # fmt: skip


def test_entries_and_lines_are_those_of_the_matrix() -> None:
    frf = _frf()
    part = frf.sel(response="TCP:+Y", excitation="TCP:+X", band=(20, 40))
    lines = slice(20, 41)
    assert isinstance(part, Frf)
    assert (part.responses, part.excitations, part.band) == (("TCP:+Y",), ("TCP:+X",), (20.0, 40.0))
    np.testing.assert_array_equal(part.frequencies, F[lines])
    np.testing.assert_array_equal(part.values, frf.values[lines, 1:2, :1])
    np.testing.assert_array_equal(part.multiple_coherence, frf.multiple_coherence[lines, 1:2])  # type: ignore[index]
    np.testing.assert_array_equal(part.coherence, frf.coherence[lines, 1:2, :1])  # type: ignore[index]
    np.testing.assert_array_equal(part.averages, [[3]])
    np.testing.assert_allclose(part.total_variance(), frf.total_variance()[lines, 1:2, :1])  # type: ignore[index]


def test_several_names_keep_their_order_and_their_covariance() -> None:
    frf = _frf()
    part = frf.sel(response=["HOUSING:+X", "TCP:+X"])
    assert part.responses == ("HOUSING:+X", "TCP:+X")
    assert part.excitations == EXCITATIONS
    np.testing.assert_array_equal(part.values, frf.values[:, [2, 0]])
    assert part.covariance is not None
    assert frf.covariance is not None
    np.testing.assert_array_equal(part.covariance.response[:, 0, 1], frf.covariance.response[:, 2, 0])
    assert part.band == frf.band
    assert frf.sel() == frf


def test_the_band_is_cut_to_the_one_in_which_the_frf_holds() -> None:
    part = _frf().sel(band=(5.0, 40.0))
    assert part.band == (10.0, 40.0)
    assert (part.frequencies[0], part.frequencies[-1]) == (5.0, 40.0)


def test_entries_that_were_not_measured_stay_marked() -> None:
    axes = ("TCP:+X", "TCP:+Y")
    values = np.zeros((len(F), 2, 2), complex)
    values[:, [0, 1], [0, 1]] = 1
    frf = Frf(F, values, axes, axes, "receptance", "m/N", F > 3, measured=np.eye(2, dtype=bool))
    assert frf.sel(response="TCP:+X", excitation="TCP:+X").measured is None
    with pytest.raises(InputError, match=re.escape("TCP:+X / TCP:+Y was not measured")):
        frf.sel(response="TCP:+X", excitation="TCP:+Y")


BAD = {
    "response": ({"response": "TCP:+Z"}, "no response TCP:+Z; there are TCP:+X, TCP:+Y, HOUSING:+X"),
    "of several": ({"response": ["TCP:+X", "q"]}, "no response q; there are TCP:+X, TCP:+Y, HOUSING:+X"),
    "excitation": ({"excitation": "HOUSING:+X"}, "no excitation HOUSING:+X; there are TCP:+X, TCP:+Y"),
    "outside": ({"band": (200, 300)}, "no line lies in 200 to 300 Hz; the FRF has 0 to 100 Hz"),
    "where it does not hold": (
        {"band": (70, 90)},
        "the FRF does not hold in 70 to 90 Hz; choose a band in 10 to 60 Hz, where it does",
    ),
    "falling": ({"band": (40, 20)}, "sel: band 40 to 20 Hz is not two increasing frequencies; give LO HI in Hz"),
    "one number": ({"band": [40]}, "band [40]: give 2 numbers LO HI, in Hz"),
    "a number": ({"response": 3}, "response 3: give a text or a list of texts"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_not_there_is_refused_with_what_is(name: str) -> None:
    given, message = BAD[name]
    with pytest.raises(InputError) as refused:
        _frf().sel(**given)  # type: ignore[arg-type]
    assert str(refused.value) == message
