"""The example of the page on hammer tests says what its picture's legend says."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "hammer_test.py"


def test_the_example_draws_a_right_frf_and_a_wrong_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    spec = importlib.util.spec_from_file_location("hammer_test", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    compared = example.compare()
    size = np.abs(compared.shifted).max()
    assert np.abs(compared.tapped - compared.shifted).max() < 0.01 * size
    assert np.abs(compared.tapped - compared.truth).max() > 0.1 * size  # the window's damping is in the values
    truth = np.abs(example.accelerance(2j * np.pi * compared.hann_frequencies))
    assert (np.abs(compared.hann) / truth).max() > 5
    example.main(tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 10_000
    assert "millfrf tap: off by" in capsys.readouterr().out
