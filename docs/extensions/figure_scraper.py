"""Figures of a gallery program, with their labels as alternative text for those who cannot see them."""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

RESOLUTION = 110
"""Dots an inch of a saved figure."""


def figures_with_words(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save and close the figures that a block made; return the text that shows them."""
    del block
    shown = []
    for number in plt.get_fignums():
        figure = plt.figure(number)
        words = str(figure.get_label())
        if not words:
            raise ValueError(f"{block_vars['src_file']}: a figure has no label; figure.set_label says it in words")
        path = Path(next(block_vars["image_path_iterator"]))
        figure.savefig(path, dpi=RESOLUTION)
        shown.append(f".. image:: /{path.relative_to(gallery_conf['src_dir']).as_posix()}\n   :alt: {words}\n")
    plt.close("all")
    return "\n\n".join(shown)
