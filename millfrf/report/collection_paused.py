"""A pause of Python's search for unused objects while pages are drawn."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def collection_paused() -> Iterator[None]:
    """Search for no unused objects inside the block.

    A figure makes enough objects to set off several full searches, each through all objects of the libraries (0.2 s).
    """
    running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if running:
            gc.enable()
