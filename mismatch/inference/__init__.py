"""From hypotheses to a verdict. Nothing here knows of structures, robots or cuts."""
