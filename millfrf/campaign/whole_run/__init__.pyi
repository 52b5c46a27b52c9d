from .campaign_run import RunOptions, RunSummary, dry_run_lines, run_campaign
from .opened import OpenedCampaign, open_campaign

__all__ = ["OpenedCampaign", "RunOptions", "RunSummary", "dry_run_lines", "open_campaign", "run_campaign"]
