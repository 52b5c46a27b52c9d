"""Between this project's files and those of other programs."""
