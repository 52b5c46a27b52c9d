"""From hypotheses to a verdict; knows nothing of structures, robots or cuts."""
