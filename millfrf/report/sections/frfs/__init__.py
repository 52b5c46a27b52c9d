"""The FRFs of a report: few as figures, many as pages of small panels, each with the misfit of its model."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
