"""Postures that a campaign did not measure: do the bands of the learned posture model hold the truth?

Run it: `python benchmarks/campaign_postures.py FIRST LAST [POSES] [NEW] [LEFT_OUT] [SESSIONS]`, such as `0 3 20 24`.
The trial itself stands in `tests/millfrf/campaign/unmeasured_postures.py`; docs/campaigns.md has the table.
"""

import os
import sys
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / part) for part in ("", "tests/millfrf/campaign")]

from unmeasured_postures import main

if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
