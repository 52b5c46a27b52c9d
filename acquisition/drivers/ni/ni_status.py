"""What the modules notice while they measure: overloads, open loops and circuits, clocks that lost each other."""

from typing import Any

from ...sources import CLEARED, FAULT, Events, device_event

_QUESTIONS = {
    "overloaded_chans": "overload",
    "open_current_loop_chans": "open current loop",
    "open_chans": "open circuit",
    "excit_fault_chans": "excitation fault",
    "sync_unlocked_chans": "not synchronized",
    "pll_unlocked_chans": "clock not locked",
}
"""Properties of a task's input stream by what they say of a channel; each is asked as ``..._exist`` first."""


class NiStatus:
    """Asks a running task for the status of its channels and tells changes.

    Parameters
    ----------
    task
        The running task; questions that its modules do not know are not asked again.
    """

    def __init__(self, task: Any) -> None:
        self._stream = task.in_stream
        self._questions = dict(_QUESTIONS)
        self._standing: set[str] = set()

    def changes(self, begun: float) -> list[Events]:
        """Faults that came and went with the last block, whose first sample had the host's time ``begun`` (s)."""
        now = self._faults()
        came = [device_event(begun, FAULT, f"channel {fault}") for fault in sorted(now - self._standing)]
        went = [device_event(begun, CLEARED, f"channel {fault}") for fault in sorted(self._standing - now)]
        self._standing = now
        return [*went, *came]

    def _faults(self) -> set[str]:
        """Each channel with each of its faults since the last question."""
        from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError

        found: set[str] = set()
        for question, words in list(self._questions.items()):
            try:
                if getattr(self._stream, f"{question}_exist"):
                    found |= {f"{name}: {words}" for name in getattr(self._stream, question)}
            except (DaqError, DaqFunctionNotSupportedError):
                del self._questions[question]
        return found
