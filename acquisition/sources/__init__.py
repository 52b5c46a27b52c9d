"""Sources of samples and feeds of events, and their wrappers: pacing, threads, a source with several feeds."""
