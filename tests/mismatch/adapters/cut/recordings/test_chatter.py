"""Chatter of a recording: a line that does not repeat with the spindle."""

import numpy as np

from millfrf.cutting import MillingProcess
from millfrf.mismatch.cut.motion import SpindleLaw
from millfrf.mismatch.cut.recordings import CutRecording, chatter_of

PROCESS = MillingProcess(2, 12e-3, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 0.15e-3)
TIMES = np.arange(20000) / 2000.0
LAW = SpindleLaw(5.0, 0.0, 84.0)


def _recording(wave: float, share: float, law: SpindleLaw = LAW) -> CutRecording:
    rng = np.random.default_rng(2)
    tooth = np.cos(2 * LAW.speed * TIMES)[:, None] * np.array([1.0, 0.7, 0.3])
    # chatter has side lines at the tooth passing, which a foreign tone has not
    modulated = 1 + 0.5 * np.cos(2 * LAW.speed * TIMES)
    other = share * (modulated * np.cos(2 * np.pi * wave * TIMES))[:, None] * np.ones(3)
    return CutRecording("r", 2000.0, tooth + other + 0.01 * rng.standard_normal((20000, 3)), (0, 1, 2), None, law, 0.5)


def test_a_strong_line_beside_the_orders_is_chatter_at_its_frequency() -> None:
    verdict = chatter_of(_recording(61.3, 2.0), PROCESS)
    assert (verdict.kind, verdict.unstable) == ("hopf", True)
    assert abs(verdict.frequency - 61.3) < 0.2


def test_the_tooth_passing_alone_is_stable() -> None:
    assert not chatter_of(_recording(61.3, 0.0), PROCESS).unstable


def test_a_sweep_is_not_judged() -> None:
    verdict = chatter_of(_recording(61.3, 2.0, SpindleLaw(5.0, 0.0, 84.0, 0.1 * 84.0 / 10)), PROCESS)
    assert (verdict.kind, verdict.unstable) == ("not judged", False)
    assert "changes by 10 %" in verdict.reason
