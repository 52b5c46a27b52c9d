"""Model updating: single changes of a robot's model, weighed against frequencies found at several postures."""
