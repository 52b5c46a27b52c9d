"""`millfrf new`: commented files to begin with, filled in as far as the given files allow."""
