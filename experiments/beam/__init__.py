"""Figures of "Non-linear Dynamics of Jointed Systems Under Dry Friction Forces"."""
