"""The example that makes the pictures of the documentation."""

import importlib.util
import shutil
from pathlib import Path
from types import ModuleType

import pytest

EXAMPLE = Path(__file__).resolve().parents[3] / "examples" / "live_page.py"


@pytest.fixture
def example() -> ModuleType:
    pytest.importorskip("PIL", reason="needs Pillow")
    spec = importlib.util.spec_from_file_location("live_page", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_its_session_plans_three_immersions(example: ModuleType, tmp_path: Path) -> None:
    immersions, duration = example.planned(tmp_path)
    assert len(immersions) == 3
    (up_start, up_exit), (central_start, central_exit), (down_start, down_exit) = immersions
    assert (up_start, down_exit) == pytest.approx((0, 180))
    assert (up_exit, down_start) == pytest.approx((45, 135))
    assert central_start + central_exit == pytest.approx(180)
    assert duration >= 40


@pytest.mark.slow
def test_it_makes_the_pictures(example: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("playwright.sync_api", reason="needs the package playwright")
    if shutil.which("chromium") is None and shutil.which("google-chrome") is None:
        pytest.skip("no Chromium on this machine")
    monkeypatch.setattr("sys.argv", ["live_page.py", str(tmp_path)])
    example.main()
    for name in ("first", "third", "end"):
        assert 20_000 < (tmp_path / "session" / f"live_page_{name}.png").stat().st_size < 200_000
