"""Robots with uncertain parameters: their files after an update, and confidence bands."""
