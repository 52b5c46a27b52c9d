"""Serial robots as joints and rigid bodies: read from URDF or DH tables, written to files."""
