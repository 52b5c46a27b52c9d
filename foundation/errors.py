"""The few named exceptions, and the one warning: a message shows the offending value and the remedy, in one line."""


class MillfrfError(Exception):
    """Base of every error this project raises on purpose; the command line ends with exit code 1."""


class InputError(MillfrfError):
    """Input that cannot be used: a wrong value, unit, length or option (exit code 2)."""


class FileFormatError(InputError):
    """A file is not what it should be: wrong kind, wrong version, damaged, or lacking a field."""


class TooLarge(InputError):
    """A job would take more memory than is allowed; elsewhere, or with another allowance, it may be done."""


class DiskFull(MillfrfError):
    """The disk or quota is full; of a recording, what was acknowledged before is kept; of other files, the old ones."""


class MillfrfWarning(UserWarning):
    """A doubt about what was given or found: the result stands, and its user should know of it."""
