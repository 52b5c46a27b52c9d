"""Recording files: written block by block, read in blocks, aligned in time and recovered after a crash."""
