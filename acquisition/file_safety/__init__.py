"""TODO(shelf)"""
