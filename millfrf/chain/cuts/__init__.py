"""What a model or a recording says of a cut: stability lobes and chatter verdicts."""
