"""Machining with a robot: tool paths, their postures, deviation of the cut, its uncertainty and compensation."""
