from .graph import Task, key_of

__all__ = ["Task", "key_of"]
