"""Campaigns: hundreds of recordings through all jobs, on one machine or a cluster, with results that stay."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
