from .failures import failure_section
from .sets import set_section

__all__ = ["failure_section", "set_section"]
