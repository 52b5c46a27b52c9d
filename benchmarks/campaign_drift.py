"""False alarms and power of the report of a campaign: drift, drifts of a pose's own, outlying sets.

Run it: `python benchmarks/campaign_drift.py [CAMPAIGNS] [FIRST SEED]`, such as `200 60000`, with seeds that no test and
no choice of a threshold has used. It prints in which share of campaigns something is named, with its 95 % interval. The
trials stand in `tests/millfrf/campaign/drift_trials.py`; docs/campaigns.md has the tables.
"""

import os
import sys
from pathlib import Path

for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(name, "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / part) for part in ("", "tests/millfrf/campaign")]

from drift_trials import main

if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]))
