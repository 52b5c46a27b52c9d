"""The page on forces that repeat tells what its example finds, its pictures are drawn, and its code runs."""

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from millfrf.figures import house_style

pytestmark = pytest.mark.shared_data

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "repeats.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def example() -> ModuleType:
    spec = importlib.util.spec_from_file_location("periodic_forces", ROOT / "examples" / "periodic_forces.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["periodic_forces"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def found(example: ModuleType, shared_data: Path) -> Any:
    return example.study(shared_data / "f16-ground-vibration")


def test_the_page_tells_what_was_found(found: Any) -> None:
    said = " ".join(PAGE.split())
    for noise in found.noises:
        shares = ", ".join(f"{share:.2f}" for share in 100 * noise.response_share)
        assert f"{shares}, {100 * noise.force_share[0]:.3f}" in said
    modes = {round(mode.frequency, 1): mode for mode in found.dependence.changes()}
    assert f"softens by {-100 * modes[7.3].frequency_change:.2f} ± 0.1 %" in said
    assert f"({100 * modes[7.3].damping_change:.0f} ± 30 %)" in said
    assert f"it softens by {-100 * modes[9.2].frequency_change:.2f} ± 0.05 %" in said
    assert f"gains {100 * modes[9.2].damping_change:.0f} ± 7 % of its damping" in said
    for fit in found.dependence.fits:
        mode = next(r for r, f in enumerate(fit.frequencies) if abs(f - 7.3) < 0.1)
        row = f"{fit.frequencies[mode]:.3f} ± {2 * fit.frequency_errors[mode]:.3f} Hz | "
        row += f"{100 * fit.damping[mode]:.3f} ± {200 * fit.damping_errors[mode]:.2f} %"
        assert row in said
        assert all(0.07 < misfit < 0.11 for misfit in fit.misfit)


def test_pictures_are_drawn(example: ModuleType, found: Any, tmp_path: Path) -> None:
    with house_style():
        for name, picture in (("spectra", example.spectra_picture), ("levels", example.levels_picture)):
            picture(found).savefig(tmp_path / f"{name}.png", dpi=50)
            assert (tmp_path / f"{name}.png").stat().st_size > 5000


def test_the_code_of_the_page_runs(shared_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert code is not None
    folder = shared_data / "f16-ground-vibration"
    exec(code[1], {"files": (folder / "level_1.h5", folder / "level_3.h5")})
    said = capsys.readouterr().out
    assert "distortion at lines above the band" in said
    assert "softens by 0.8" in said
