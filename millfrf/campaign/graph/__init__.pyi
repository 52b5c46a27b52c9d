from .task import Task
from .task_key import key_of

__all__ = ["Task", "key_of"]
