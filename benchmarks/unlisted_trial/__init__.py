"""Trial of the diagnosis with effects that its library does not list: ``python -m benchmarks.unlisted_trial``."""
