"""Instruments of an estimate: channels that drive the forces and that no disturbance reaches."""

import os
from collections.abc import Sequence
from dataclasses import replace

from acquisition import Recording
from estimation import CrossSpectra, choose_channels
from millfrf.core import InputError


def channels_with_instruments(
    path: str | os.PathLike[str],
    stream: str | None,
    names: tuple[Sequence[str], Sequence[str]],
    instruments: Sequence[str],
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of forces and of responses, without the instruments among them.

    Raises
    ------
    InputError
        An instrument that is not there, or none left beside them.
    """
    with Recording(path) as recording:
        source = recording.stream(stream)
        source.columns(instruments)  # refuses names that are not there
        chosen = choose_channels(source, names[0] or None, names[1] or None)
    forces, responses = (tuple(one.name for one in each if one.name not in instruments) for each in chosen)
    if not forces or not responses:
        role = "excites" if not forces else "responds"
        raise InputError(
            f"no channel {role} beside the instrument{'s' if len(instruments) > 1 else ''} {', '.join(instruments)}; "
            f"name {'--excitation' if not forces else '--response'} channels and others as --instrument"
        )
    return forces, responses


def only_inputs(spectra: CrossSpectra, names: Sequence[str]) -> CrossSpectra:
    """The spectra with some of the excitations only."""
    kept = [number for number, channel in enumerate(spectra.excitations) if channel.name in names]
    return replace(
        spectra,
        input_spectra=spectra.input_spectra[:, kept][:, :, kept],
        cross_spectra=spectra.cross_spectra[:, :, kept],
        excitations=tuple(spectra.excitations[number] for number in kept),
    )
