"""Sections and folded parts of the modal-fitting report."""
