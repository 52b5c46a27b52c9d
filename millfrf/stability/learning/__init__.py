"""Learning from cuts in production: verdicts and chatter frequencies bring a structure and its cut up to date."""
