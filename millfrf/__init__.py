"""Command line, reports and the demonstration: the face of the project."""
