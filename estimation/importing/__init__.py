"""FRFs of other programs: UFF, MAT, NPZ, CSV and the text exports of analysers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
