"""Curves of small panels: within a tenth of a millimetre of the truth, in few bytes."""

import base64
import re

import numpy as np

from millfrf.figures import SmallSvg


def drawn(x: np.ndarray, y: np.ndarray) -> tuple[list[np.ndarray], int]:
    page = SmallSvg(100.0, 50.0, "")
    page.curve(x, y, "m")
    text = base64.b64decode(page.uri().partition(",")[2]).decode()
    paths = []
    for path in re.findall(r"M([^M\"]*)", text):
        numbers = np.array([int(word) for word in re.findall(r"-?\d+", path)]).reshape(-1, 2)
        paths.append(np.cumsum(numbers, axis=0) / 10)
    return paths, len(text)


def test_a_resonance_keeps_its_peak_and_its_shape() -> None:
    x = np.linspace(0, 40, 3001)
    y = 25 - 12 * np.log10(1 / np.abs(1 - (x / 20) ** 2 + 0.004j * x / 20))
    [path], size = drawn(x, y)
    assert abs(path[:, 1].min() - y.min()) <= 0.1
    along = np.linspace(0, len(path) - 1, 40_000)
    dense = np.column_stack([np.interp(along, np.arange(len(path)), path[:, k]) for k in range(2)])
    distance = [np.hypot(dense[:, 0] - a, dense[:, 1] - b).min() for a, b in zip(x[::7], y[::7], strict=True)]
    assert max(distance) < 0.15  # mm
    assert size < 3000  # 3001 points


def test_gaps_break_the_line_and_nothing_draws_nothing() -> None:
    x = np.linspace(0, 10, 101)
    y = np.sin(x)
    y[40:60] = np.nan
    paths, _ = drawn(x, y)
    assert len(paths) == 2
    assert drawn(x, np.full(101, np.nan))[0] == []
