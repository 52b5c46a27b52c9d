"""The page to work on: files, FRFs, modes, cuts, diagnosis; each of its steps is a command that can be repeated."""
