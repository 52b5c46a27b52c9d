"""The modal-fitting report: one self-contained page that a laboratory attaches to its test sheet."""
