"""Chatter verdicts: was a recorded cut stable?"""
