"""Cross spectra of a recording: which channels, and one pass over the file."""

from collections.abc import Callable, Sequence

from acquisition import Channel, Recording, Stream
from foundation import InputError

from .spectral_accumulator import SpectralAccumulator
from .spectral_matrix import CrossSpectra, SpectralSettings
from .trusted_samples import usable_samples

EXCITING = ("force", "moment", "voltage")
RESPONDING = ("acceleration", "velocity", "displacement")


def choose_channels(
    stream: Stream, excitations: Sequence[str] | None = None, responses: Sequence[str] | None = None
) -> tuple[tuple[Channel, ...], tuple[Channel, ...]]:
    """Excitation and response channels, by name or by quantity.

    Without names, forces, moments and voltages excite; accelerations, velocities and displacements respond.

    Raises
    ------
    InputError
        A name that is not there, or none of the needed quantities.
    """
    chosen = []
    for names, quantities, role in ((excitations, EXCITING, "excites"), (responses, RESPONDING, "responds")):
        if names:
            found = tuple(stream.channels[column] for column in stream.columns(names))
        else:
            found = tuple(channel for channel in stream.channels if channel.quantity in quantities)
        if not found:
            listed = ", ".join(f"{channel.name} ({channel.quantity})" for channel in stream.channels)
            raise InputError(
                f"{stream.path.name}: no channel {role} ({' or '.join(quantities[:3])} is needed); it has {listed}. "
                "Name the channels to use"
            )
        chosen.append(found)
    return chosen[0], chosen[1]


def cross_spectra(
    recording: Recording,
    settings: SpectralSettings,
    *,
    stream: str | None = None,
    excitations: Sequence[str] | None = None,
    responses: Sequence[str] | None = None,
    exclude_unusable: bool = False,
    progress: Callable[[int], None] | None = None,
) -> CrossSpectra:
    """Compute Welch spectra of one recording, read once, block by block.

    Parameters
    ----------
    recording
        Open recording to read.
    settings
        Settings of the spectra: segment length, overlap, window, detrending.
    stream
        Name of the sample clock; None: the only one.
    excitations, responses
        Names of the channels; None: chosen by quantity, see :func:`choose_channels`.
    exclude_unusable
        Whether to leave out segments with overload, clipping, dropped or missing samples (:func:`usable_samples`).
    progress
        Called with the number of samples read so far.

    Raises
    ------
    InputError
        Channels that are not there, a record shorter than a segment, or samples that are not finite.
    """
    source = recording.stream(stream)
    exciting, responding = choose_channels(source, excitations, responses)
    accumulator = SpectralAccumulator(exciting, responding, source.sample_rate, settings)
    names = [channel.name for channel in (*exciting, *responding)]
    done = 0
    try:
        for block in source.blocks(1 << 14, names):
            usable = usable_samples(block, (*exciting, *responding)) if exclude_unusable else None
            accumulator.add(block[:, : len(exciting)], block[:, len(exciting) :], usable)
            done += len(block)
            if progress is not None:
                progress(done)
        return accumulator.finish()
    except InputError as error:
        raise InputError(f"{recording.path.name}: {error}") from error
