"""Robot files: TOML tables of planar, serial and spatial robots, checked when they are read."""
