"""Before and during a measurement: plan, check of the signals, recording."""
