"""Synthetic records by the hundred: whether fits and their intervals keep what they promise."""
