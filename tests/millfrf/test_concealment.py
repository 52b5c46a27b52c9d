"""The blind demonstration: the seal holds, the judgement is fair, and the whole of it runs."""

import json
from pathlib import Path
from typing import Any

import pytest

from millfrf.core import InputError
from millfrf.demonstration.concealment import (
    PADDED,
    ConcealOptions,
    concealment_table,
    direction_error,
    judgement,
    open_seal,
    run_concealed,
    seal,
)
from replay_data import FOREIGN, ConcealedEffect

CONTENT = {"name": "backlash", "direction": [0.6, 0.0, 0.8], "parameters": {"half_gap_m": 1e-5}}


def test_what_is_sealed_comes_back(tmp_path: Path) -> None:
    assert open_seal(seal(tmp_path / "sealed.bin", CONTENT)) == CONTENT


def test_the_sealed_file_tells_nothing(tmp_path: Path) -> None:
    first, second = (seal(tmp_path / name, CONTENT) for name in ("a", "b"))
    hidden = first.path.read_bytes()
    assert len(hidden) == PADDED == len(seal(tmp_path / "c", {"name": "none"}).path.read_bytes())
    assert b"backlash" not in hidden
    assert hidden != second.path.read_bytes()
    assert first.fingerprint != second.fingerprint  # salted: names cannot be tried against it
    assert first.key.hex() not in repr(first)
    assert first.key not in hidden


@pytest.mark.parametrize("where", [0, 100, PADDED - 1])
def test_a_file_that_was_touched_is_refused(tmp_path: Path, where: int) -> None:
    sealed = seal(tmp_path / "sealed.bin", CONTENT)
    hidden = bytearray(sealed.path.read_bytes())
    hidden[where] ^= 1
    sealed.path.write_bytes(hidden)
    with pytest.raises(InputError, match="has been changed since it was sealed"):
        open_seal(sealed)


def test_a_file_cut_short_or_gone_is_refused(tmp_path: Path) -> None:
    sealed = seal(tmp_path / "sealed.bin", CONTENT)
    sealed.path.write_bytes(b"short")
    with pytest.raises(InputError, match="has been changed"):
        open_seal(sealed)
    sealed.path.unlink()
    with pytest.raises(InputError, match="cannot read the sealed file"):
        open_seal(sealed)


def test_what_does_not_fit_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="bytes to seal"):
        seal(tmp_path / "sealed.bin", {"name": "x" * PADDED})


def diagnosis(verdict: str, *names: str, equivalents: tuple[str, ...] = ()) -> dict[str, Any]:
    causes = [{"name": name, "location": {"direction": [0.0, 0.0, -1.0]}, "parameters": {}} for name in names]
    return {"verdict": verdict, "physics": causes, "equivalents": list(equivalents)}


@pytest.mark.parametrize(
    ("hidden", "found", "expected"),
    [
        ("none", diagnosis("none"), "right"),
        ("none", diagnosis("explained", "backlash"), "wrong"),
        ("backlash", diagnosis("explained", "backlash"), "right"),
        ("backlash", diagnosis("partly explained", "backlash"), "right, in part"),
        ("backlash", diagnosis("explained", "backlash", "clipping"), "right, and more"),
        ("backlash", diagnosis("explained", "hysteresis", equivalents=("backlash",)), "right within a class"),
        ("backlash", diagnosis("explained", "hysteresis"), "wrong"),
        ("backlash", diagnosis("none"), "missed"),
        ("backlash", diagnosis("unexplained", "hysteresis"), "abstained"),
        (FOREIGN, diagnosis("unexplained"), "right"),
        (FOREIGN, diagnosis("explained", "backlash"), "wrong"),
    ],
)
def test_judgement(hidden: str, found: dict[str, Any], expected: str) -> None:
    assert judgement(hidden, found) == expected


def test_direction_error_knows_no_sign() -> None:
    effect = ConcealedEffect("backlash", (0.6, 0.0, 0.8), {})
    assert direction_error(effect, diagnosis("explained", "backlash")) == pytest.approx(36.87, abs=0.01)
    assert direction_error(ConcealedEffect("none", None, {}), diagnosis("explained", "backlash")) is None


@pytest.mark.parametrize(("options", "message"), [({"noise": -1.0}, "noise"), ({"seed": -1}, "seed")])
def test_impossible_options_are_refused(tmp_path: Path, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        run_concealed(ConcealOptions(tmp_path, **options))


@pytest.mark.slow
def test_a_hidden_drift_is_found(tmp_path: Path) -> None:
    said: list[str] = []
    result = run_concealed(ConcealOptions(tmp_path, seed=9, effect="pose_drift"), say=said.append)
    assert result.hidden.name == "pose_drift"
    assert judgement("pose_drift", result.diagnosis) == "right"
    angle = direction_error(result.hidden, result.diagnosis)
    assert angle is not None
    assert angle < 2.0
    (cause,) = result.diagnosis["physics"]
    change = result.hidden.parameters["stiffness_change_n_per_m"]
    assert cause["parameters"]["stiffness_change_n_per_m"] == pytest.approx(change, rel=0.05)
    fingerprint = next(number for number, line in enumerate(said) if result.fingerprint in line)
    assert fingerprint < next(number for number, line in enumerate(said) if line.strip().startswith("verdict"))
    assert json.loads((tmp_path / "nominal.json").read_text())["quantity"] == "receptance"
    assert "pose_drift" in str(concealment_table(result).rows)
