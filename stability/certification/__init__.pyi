from .certified import certified_lobes

__all__ = [
    "certified_lobes",
]
