"""The cutting process on the command line: which physics a computed cutting force leaves out."""
