"""CAMPAIGN.toml: what is to be done, with which recordings, and what they are labelled with."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
