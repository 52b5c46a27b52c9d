"""`campaign.toml` and `cut.toml` of the simulated campaign."""

from pathlib import Path

from millfrf.cutting import write_cutting_process

from .at_rest import BAND
from .recordings import CUTTER

CUT = "cut.toml"

CAMPAIGN = f"""# A simulated campaign: poses x immersions x sessions of a milling robot. What is hidden in it
# stands in concealed.json.
[campaign]
title = "Simulated campaign on a {{robot}}"
robot = "{{robot}}"

[[recordings]]
files = ["recordings/*.h5"]
pattern = "(?P<pose>P\\\\d+)_(?P<immersion>[a-z]+)_(?P<session>\\\\d+)"

[recordings.setup]
posture_deg = "robot.posture_deg"
temperature_c = "conditions.temperature_c"
level = "conditions.level"

# Recordings of one pose, session and level are stacked: three immersions make the forces independent.
[sets]
by = ["pose", "session", "level"]

[fit]
method = "subspace"
band_hz = [{BAND[0]}, {BAND[1]}]

[calibrate]
tip = "taps/{{{{pose}}}}_tip.h5"
sensor = "taps/{{{{pose}}}}_housing.h5"

[lobes]
cutting = "{CUT}"
speeds_rpm = [1200, 2400, 5]
max_depth_m = 0.02

[diagnose]
model = "idle/{{{{pose}}}}.json"
by = ["pose"]

[learn]

[report]
"""


def write_campaign_files(folder: Path, robot: str) -> None:
    """Write both files into the campaign's folder."""
    (folder / "campaign.toml").write_text(CAMPAIGN.format(robot=robot), encoding="utf-8")
    write_cutting_process(folder / CUT, CUTTER)
