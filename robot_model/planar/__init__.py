"""Planar robots: rigid links on joint springs, flexible links, and natural coordinates."""
