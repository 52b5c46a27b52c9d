"""`millfrf robot diagnose`: the command, its run, and its words."""
