"""The figures of the gallery as pictures of the pages: `python examples/gallery_pictures.py [FOLDER]`.

Runs every program of `examples/gallery` and saves its last figure as `show_NAME.png`, by default in `docs/pictures`.
"""

import runpy
import sys
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent


def draw(program: Path, folder: Path) -> Path:
    """Run one program and save the last figure that it leaves."""
    plt.close("all")
    runpy.run_path(str(program))
    number = plt.get_fignums()[-1]
    picture = folder / f"{program.stem}.png"
    plt.figure(number).savefig(picture, dpi=130)
    return picture


def main(folder: Path) -> None:
    """Draw all of them."""
    for program in sorted((HERE / "gallery").glob("show_*.py")):
        print(draw(program, folder))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE.parent / "docs" / "pictures")
