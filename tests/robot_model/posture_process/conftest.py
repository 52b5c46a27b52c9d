"""The independent robot and the cell made of it, loaded from their files: test folders are no packages."""

import importlib.util
import sys
from pathlib import Path

HERE = Path(__file__).parent


def _loaded(path: Path) -> None:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)


_loaded(HERE.parents[1] / "mismatch/adapters/robot/independent_robot.py")
_loaded(HERE / "nonlinear_cell.py")
_loaded(HERE / "measured_cell.py")
_loaded(HERE / "plain_process.py")
_loaded(HERE / "trial.py")
