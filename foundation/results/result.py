"""`Result`: base of the frozen dataclasses that a user holds at a prompt or in a notebook."""

from .equality import same_values
from .summary import Summary


class Result:
    """Equality by value, a short text and a small HTML table, for ``@dataclass(frozen=True, eq=False, repr=False)``.

    Two results are equal if they are of one type and all their fields are equal, arrays element by element. A result
    holds arrays, whose elements can be changed; it therefore has no hash.
    """

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return same_values(self, other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return self._summary().text()

    def _repr_html_(self) -> str:
        return self._summary().html()

    def _summary(self) -> Summary:
        """Give the few facts that matter of this result.

        Raises
        ------
        NotImplementedError
            A type that does not say what it holds.
        """
        raise NotImplementedError(f"{type(self).__name__} says nothing of itself")
