"""Sources of samples and feeds of events, and what wraps them: pacing, threads, several feeds beside one source."""
