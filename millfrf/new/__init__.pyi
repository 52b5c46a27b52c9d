from .new_commands import new_app

__all__ = [
    "new_app",
]
