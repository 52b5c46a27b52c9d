"""Cost of lobes over the shape of the cutter, as a ratio to straight edges: `python -m benchmarks.cutter_speed`.

Two modes in three directions, 96 speeds from 600 to 3000 rpm, depths up to 5 mm, certified limits. Processor time, the
better of two runs after a first that loads compiled code.
"""

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from math import pi, radians

import numpy as np

from benchmarks.lobe_speed import processor
from millfrf.cutting import MillingProcess, ball_profile, bull_nose_profile
from millfrf.stability import certified_numerics
from replay_data import table_one_model

SPEEDS, DEEPEST, DIAMETER = np.linspace(600, 3000, 96) * pi / 30, 5e-3, 10e-3
SHAPES: dict[str, dict[str, object]] = {
    "straight edges": {},
    "helix 35 deg": {"helix_angle": radians(35)},
    "pitch 100, 120, 140 deg": {"pitch_angles": tuple(np.radians([100.0, 120.0, 140.0]).tolist())},
    "process damping": {"process_damping": 3e4},
    "helix 35, 36, 35 deg": {"helix_angles": tuple(np.radians([35.0, 36.0, 35.0]).tolist())},
    "bull nose 1 mm": {"helix_angle": radians(35), "profile": bull_nose_profile(DIAMETER, 1e-3)},
    "ball": {"helix_angle": radians(35), "profile": ball_profile(DIAMETER)},
}


def main() -> None:
    """Print milliseconds a speed and the ratio to straight edges."""
    plain = None
    for name, shape in SHAPES.items():
        cut = MillingProcess(3, DIAMETER, pi / 2, 2e8, 0.3, 0.1, pi / 2, pi, 1e-4, **shape)  # type: ignore[arg-type]
        seconds, lobes = processor(certified_numerics, table_one_model(), cut, SPEEDS, DEEPEST)
        single = 1e3 * seconds / len(SPEEDS)
        plain = plain or single
        verified = lobes.status.count("verified")
        print(
            f"{name:>24s} {single:7.2f} ms a speed, {single / plain:5.1f} times; {verified} of {len(SPEEDS)} verified"
        )


if __name__ == "__main__":
    main()
