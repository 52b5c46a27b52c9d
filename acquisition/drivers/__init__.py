"""One driver a file; each is a `Source`."""
