"""The jobs of a campaign, one a file: each does what a command does, and writes into a folder."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
