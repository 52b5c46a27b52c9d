"""The one table of a campaign: a row a mode of each set, as CSV and as Parquet."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
