from .plan import Plan, in_order
from .planning import ALL, plan_campaign
from .recording_sets import RecordingSet
from .spectra_tasks import FAN_IN
from .task import Task
from .task_key import key_of, keys_of

__all__ = ["ALL", "FAN_IN", "Plan", "RecordingSet", "Task", "in_order", "key_of", "keys_of", "plan_campaign"]
