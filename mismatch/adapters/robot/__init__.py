"""What is wrong with a robot's model: recordings in several postures against a few numbers of the robot."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
