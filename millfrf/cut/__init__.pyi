from .commands import cut_app

__all__ = [
    "cut_app",
]
