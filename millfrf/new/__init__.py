"""`millfrf new`: a commented file to begin with, filled in from what there is."""
