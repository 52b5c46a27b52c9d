"""Tool paths: places of the cut, postures that reach them, and the best continuous sequence of postures."""
