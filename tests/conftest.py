"""Shared fixtures: where measured data of other laboratories lies, and how Hypothesis is seeded."""

import os
from pathlib import Path

import pytest
from hypothesis import settings

from millfrf.core.compilation import KERNELS, compile_kernels

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of measured data, ``../shared/data`` or ``$MILLFRF_SHARED/data``; the test skips without it."""
    root = Path(__file__).resolve().parents[1]
    folder = Path(os.environ.get("MILLFRF_SHARED", root.parent / "shared")) / "data"
    if not folder.is_dir():
        pytest.skip(f"measured data of other laboratories are not at {folder}; set MILLFRF_SHARED to the folder above")
    return folder


def pytest_configure(config: pytest.Config) -> None:
    """Compile all kernels before the first test, so that no two workers compile the same one."""
    if not hasattr(config, "workerinput"):
        compile_kernels(*KERNELS)
