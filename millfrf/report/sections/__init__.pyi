from .chatter import chatter_in_brief, chatter_section
from .comparison import comparison_section
from .frfs import frf_section
from .hammer import hammer_section
from .measurement import channel_section, file_section, settings_section, setup_section
from .reciprocity import reciprocity_section
from .results import input_section, mode_section
from .stability import stability_findings

__all__ = [
    "channel_section",
    "chatter_in_brief",
    "chatter_section",
    "comparison_section",
    "file_section",
    "frf_section",
    "hammer_section",
    "input_section",
    "mode_section",
    "reciprocity_section",
    "settings_section",
    "setup_section",
    "stability_findings",
]
