"""The recordings of one set-up as witnesses of each other: delays, clocks, signs, sizes and places of channels."""

from collections.abc import Sequence

from acquisition import Recording

from .agreement import check_agreement
from .cut_witness import check_cuts
from .onsets import check_onsets, onsets_of
from .record_blocks import blocks_of_recordings


def check_consistency(
    recordings: Sequence[Recording],
    stream: str | None = None,
    excitations: Sequence[str] = (),
    responses: Sequence[str] = (),
) -> list[str]:
    """Compare forces and responses of recordings within each recording and between them, and return warnings.

    Parameters
    ----------
    recordings
        Open recordings of one set-up.
    stream
        Sample clock; None: the only one.
    excitations, responses
        Channel names; empty: chosen by quantity.
    """
    tests = blocks_of_recordings(recordings, stream, excitations, responses)
    late = check_onsets([onsets_of(test) for test in tests])
    # a delay makes signs and sizes disagree, too
    return [*(late or check_agreement(tests)), *check_cuts(tests)]
