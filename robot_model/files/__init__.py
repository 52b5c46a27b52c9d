"""Robots as data: TOML files of planar and spatial robots, checked where they enter."""
