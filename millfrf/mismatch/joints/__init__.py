"""The force law of one joint, and its simulation on a modal structure."""
