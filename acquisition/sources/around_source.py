"""The parts that a source passes on unchanged when it wraps another one."""

from .source import Source, StreamDescription


class AroundSource:
    """Title, set-up, streams and number of samples of the source within.

    Parameters
    ----------
    source
        The one that is wrapped.
    """

    def __init__(self, source: Source) -> None:
        self._source = source

    @property
    def title(self) -> str:
        """The source's title."""
        return self._source.title

    @property
    def setup(self) -> str:
        """The source's setup."""
        return self._source.setup

    @property
    def streams(self) -> tuple[StreamDescription, ...]:
        """The source's streams."""
        return self._source.streams

    @property
    def n_samples(self) -> int | None:
        """The source's number of samples."""
        return self._source.n_samples

    @property
    def notices(self) -> tuple[str, ...]:
        """What the source says of its settings before it runs, one sentence each."""
        return tuple(getattr(self._source, "notices", ()))
