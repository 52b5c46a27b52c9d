"""Double hits in hammer tests, said when a recording is looked at."""

from collections.abc import Sequence

import numpy as np

from acquisition import Stream
from estimation import find_taps

from ..gate import IMPULSIVE, LONGEST, ChannelLevel


def tap_concerns(stream: Stream, levels: Sequence[ChannelLevel]) -> list[str]:
    """One sentence for each force channel with double hits."""
    found = []
    for level in levels:
        if level.channel.quantity != "force" or stream.duration > LONGEST or level.n_missing:
            continue
        if level.deviation == 0 or level.peak < IMPULSIVE * level.deviation:
            continue
        force = np.concatenate([block[:, 0] for block in stream.blocks(channels=[level.channel.name])])
        taps = find_taps(force, stream.sample_rate)
        double = [tap for tap in taps if tap.second_hit is not None]
        if double:
            times = ", ".join(f"{stream.start_time + tap.time:.3f} s" for tap in double[:5])
            found.append(
                f"{level.channel.name}: {len(double)} of {len(taps)} taps hit twice (at {times}; the first after "
                f"{1e3 * (double[0].second_hit or 0):.1f} ms with {100 * double[0].second_share:.0f} %); "
                "'millfrf tap' leaves them out"
            )
    return found
