"""Trial of learned postures: coverage of bands, and four ways to predict a posture beside each other.

Run it: `python benchmarks/posture_trial.py FIRST LAST [POSTURES] [NEW]`, for example `100 124 12 6`: seeds 100 to 123,
12 measured postures and 6 new ones each; about 40 s a seed on one core. The simulated cell stands in
`tests/robot_model/posture_process/`; docs/robot_postures.md has the table.
"""

import os
import sys
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / part) for part in ("", "tests/robot_model/posture_process", "tests/mismatch/adapters/robot")]

from trial import main

if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
