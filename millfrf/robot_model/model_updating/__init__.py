"""Updating of a robot's model: single changes and all uncertain parameters, from measurements in some postures."""
