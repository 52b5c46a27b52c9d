"""A diagnosis drawn into axes: the errors on data that no fit has seen, beside the noise."""

from matplotlib.axes import Axes

from mismatch import Diagnosis

from ..axes import given_or_new
from ..style import COLOURS, SHADE


def draw_diagnosis(found: Diagnosis[object], axes: Axes | None = None) -> Axes:
    """Bars of the error on held-out data: nominal, refitted and improved; a dashed line marks the noise.

    Parameters
    ----------
    found
        Diagnosis of a structure, a robot or a cut.
    axes
        Axes to draw into; None: new ones.
    """
    gain = found.improvement
    values = [100 * value for value in (gain.before, gain.refitted, gain.after)]
    with given_or_new(axes, 62.0) as shown:
        names = ["nominal", "refitted", "improved"]
        bars = shown.barh(names, values, color=[SHADE, SHADE, COLOURS[1]], edgecolor="black", linewidth=0.6)
        shown.bar_label(
            bars, [f"{value:.3g} %" for value in values], padding=3, fontsize=shown.yaxis.label.get_fontsize()
        )
        noise = 100 * gain.noise_floor
        shown.axvline(noise, color="black", linestyle=(0, (5, 1.5)), linewidth=1.1, label=f"noise, {noise:.3g} %")
        shown.invert_yaxis()
        shown.set_xlim(0, 1.2 * max(*values, noise))
        shown.set_xlabel(f"Error on {gain.where}, share of the root mean square response (%)")
        shown.set_title(f"Verdict: {found.verdict}")
        size = shown.xaxis.label.get_fontsize()
        shown.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=size)
    return shown
