from .line_slopes import Slopes, jacobian, slopes

__all__ = ["Slopes", "jacobian", "slopes"]
