"""Hypotheses about a structure: a modal model with causes, its prediction, its misfit and its fit."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
