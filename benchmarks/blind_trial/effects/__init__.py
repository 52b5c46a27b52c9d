"""The causes that a case can conceal: those on the practice list, and foreign ones that no list has."""

from benchmarks.blind_trial.effects import chain, friction, joint, surroundings

from .change import Change, Effect, Scene

LISTED: dict[str, Effect] = {
    effect.name: effect for module in (joint, friction, chain, surroundings) for effect in module.EFFECTS
}
NOT_SOUGHT: dict[str, Effect] = {effect.name: effect for effect in surroundings.NOT_SOUGHT}
FOREIGN: dict[str, Effect] = {
    effect.name: effect for module in (joint, chain, surroundings) for effect in module.FOREIGN
}
ALL: dict[str, Effect] = {**LISTED, **NOT_SOUGHT, **FOREIGN}

__all__ = ["ALL", "FOREIGN", "LISTED", "NOT_SOUGHT", "Change", "Effect", "Scene"]
