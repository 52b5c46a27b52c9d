"""What a hypothesis leaves of the recordings, and whether that is noise."""
