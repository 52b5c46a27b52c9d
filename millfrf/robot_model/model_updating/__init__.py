"""Model updating: single changes of a robot's model, tested against frequencies measured in several postures."""
