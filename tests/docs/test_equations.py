"""Equations of the pages become MathML that a browser can read; what is not understood is told."""

import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def equations() -> Iterator[Any]:
    """The extension of the site."""
    sys.path.insert(0, str(ROOT / "docs" / "extensions"))
    yield importlib.import_module("offline_equations")
    sys.path.remove(str(ROOT / "docs" / "extensions"))


def _warnings(equations: Any, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    stated: list[str] = []
    monkeypatch.setattr(equations._LOG, "warning", lambda text, *values, **_: stated.append(text % values))
    return stated


def test_every_equation_of_the_pages_is_understood(equations: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    stated = _warnings(equations, monkeypatch)
    pages = [path.read_text(encoding="utf-8") for path in (ROOT / "docs").glob("*.md")]
    pages = [re.sub(r"```.*?```|`[^`\n]*`", "", page, flags=re.DOTALL) for page in pages]
    result = [text for page in pages for text in re.findall(r"\$\$(.*?)\$\$", page, re.DOTALL)]
    pages = [re.sub(r"\$\$.*?\$\$", "", page, flags=re.DOTALL) for page in pages]
    result += [text for page in pages for text in re.findall(r"\$([^$]+)\$", page)]
    assert len(result) > 40
    for text in result:
        assert ElementTree.fromstring(equations.mathml(text, "block")).tag.endswith("math")
    assert stated == []


@pytest.mark.parametrize("latex", [r"\unheardof{x}", r"\begin{aligned} a &= b \\ c &= d \end{aligned}"])
def test_what_is_not_understood_is_told(equations: Any, monkeypatch: pytest.MonkeyPatch, latex: str) -> None:
    stated = _warnings(equations, monkeypatch)
    equations.mathml(latex, "block")
    assert len(stated) == 1
    assert "not understood" in stated[0]
