"""Data sets of Universal File Format files, read line by line or with pyuff."""
