from .graph import Task, key_of
from .results import MeasuredSet, write_summary
from .simulated import SimulatedCampaign, make_campaign

__all__ = ["MeasuredSet", "SimulatedCampaign", "Task", "key_of", "make_campaign", "write_summary"]
