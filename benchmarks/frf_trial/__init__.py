"""A trial of modal fits on FRFs: simulated sets with known modes, sets of other laboratories, and rivals beside it.

Nothing here imports the fit but :mod:`.ours`; sets are synthesised, and answers judged, by lines of their own.
"""
