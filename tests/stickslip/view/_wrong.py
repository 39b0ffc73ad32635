"""A module for the viewer whose function takes another name."""


def orbit(b):
    """Never called."""
