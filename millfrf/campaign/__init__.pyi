from .configuration import CampaignFile
from .graph import Task, key_of
from .results import MeasuredSet, write_summary
from .simulated import SimulatedCampaign, make_campaign
from .whole_run import RunOptions, RunSummary, dry_run_lines, open_campaign, run_campaign

__all__ = [
    "CampaignFile",
    "MeasuredSet",
    "RunOptions",
    "RunSummary",
    "SimulatedCampaign",
    "Task",
    "dry_run_lines",
    "key_of",
    "make_campaign",
    "open_campaign",
    "run_campaign",
    "write_summary",
]
