"""Laws of joints with more freedom than their names have: a linear part beside them, or a free form."""

from dataclasses import replace
from typing import Any

import numpy as np

from ..physics import FreeForm, JointPhysics, WithLinearPart, families
from .cause import Cause, held_values
from .hypothesis import Hypothesis

EVERYTHING = "xvmt"
"""All families: deflection (x), velocity (v), memory (m), time (t)."""

OF_FAMILY = {"x": "x", "v": "vm", "m": "vm", "t": "t"}
"""Families whose shapes may mend a law of each family: dry friction gives way elastically before it slides."""


def with_linear_part(cause: Cause) -> Cause:
    """A joint's cause with a spring and a damper of zero strength beside its law.

    Parameters
    ----------
    cause
        A law of a joint with its numbers.
    """
    assert cause.motion is not None
    assert isinstance(cause.physics, JointPhysics)
    physics = WithLinearPart(cause.physics, cause.motion)
    return replace(cause, physics=physics, values=np.append(cause.values, [0.0, 0.0]))


def with_free_forms(hypothesis: Hypothesis, kinds: str = "") -> Hypothesis:
    """A hypothesis in which the form of each joint's law is free; its prediction is the same.

    Parameters
    ----------
    hypothesis
        A hypothesis with laws of joints.
    kinds
        Families of the shapes; empty: for each law those that may mend one of its family.
    """
    causes = tuple(one if one.axis is None else _freed(one, kinds) for one in hypothesis.causes)
    return replace(hypothesis, causes=causes)


def _freed(cause: Cause, kinds: str) -> Cause:
    """The law of a cause with shapes of factor zero."""
    assert isinstance(cause.physics, JointPhysics)
    mending = "".join(OF_FAMILY[one] for one in families(cause.law()))
    kinds = "".join(kind for kind in EVERYTHING if kind in (kinds or mending))
    # a protocol's attributes can be set, those of a frozen record cannot
    physics: Any = FreeForm(cause.physics, kinds)
    own = held_values(cause)
    return replace(cause, physics=physics, values=np.concatenate([own, np.zeros(len(physics.parameters) - len(own))]))
