"""What the samples of a recording show by themselves, in one pass over the file."""

from .channel_levels import ChannelLevel, level_table
from .one_pass import Look, look, rate_concerns

__all__ = ["ChannelLevel", "Look", "level_table", "look", "rate_concerns"]
