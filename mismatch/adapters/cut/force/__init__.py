"""The cutting force that a process gives along a recording, its lines and its noise."""
