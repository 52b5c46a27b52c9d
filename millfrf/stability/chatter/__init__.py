"""Verdict of chatter on a recorded cut."""
