"""Results of a campaign: the table of modes, drift and outliers, maps over postures, and the report."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
