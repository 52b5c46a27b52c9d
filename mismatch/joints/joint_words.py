"""The place of a joint in words."""

from collections.abc import Mapping, Sequence
from typing import Any

LEAST_PART = 0.1
"""Part of a mode below which it is not named."""


def joint_in_words(location: Mapping[str, Any], axes: Sequence[str] = ()) -> str:
    """The place of a joint as a sentence goes on; empty where a location is that of no joint.

    Parameters
    ----------
    location
        Location of a cause in a diagnosis.
    axes
        Axes over which a direction at the tip is counted; empty: they are not named.

    Examples
    --------
    >>> joint_in_words({"direction": [0.8, -0.6]}, ("X", "Y"))
    'along +0.800 X, -0.600 Y'
    >>> joint_in_words({"direction": [0.8, -0.6], "participation": []}, ("X", "Y"))
    'inside, nearly along +0.800 X, -0.600 Y'
    >>> parts = [{"mode_hz": 7.3, "part": 0.95}, {"mode_hz": 11.0, "part": -0.3}]
    >>> joint_in_words({"participation": parts})
    'inside: the mode at 7.3 Hz takes part with +0.95, that at 11 Hz with -0.30'
    >>> places = [{"place": "between WING and PAYLOAD along Z"}, {"place": "WING:+Z to ground"}]
    >>> joint_in_words({"participation": parts[:1], "places": places})
    'between WING and PAYLOAD along Z: the mode at 7.3 Hz takes part with +0.95 (or, as likely, WING:+Z to ground)'
    """
    places = [str(one["place"]) for one in location.get("places", ())]
    other = f" (or, as likely, {', or '.join(places[1:])})" if len(places) > 1 else ""
    if "direction" in location:
        named = list(axes) + [""] * (len(location["direction"]) - len(axes))
        parts = [f"{value:+.3f} {name}".rstrip() for value, name in zip(location["direction"], named, strict=False)]
        nearly = "inside, nearly " if "participation" in location else ""
        return f"{nearly}along " + ", ".join(parts) + other
    if "participation" not in location:
        return ""
    told = [one for one in location["participation"] if abs(one["part"]) >= LEAST_PART]
    said = [f"at {one['mode_hz']:.4g} Hz with {one['part']:+.2f}" for one in told]
    said[0] = said[0].replace(" Hz with", " Hz takes part with")
    return f"{places[0] if places else 'inside'}: the mode " + ", that ".join(said) + other
