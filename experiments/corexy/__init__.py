"""Figures of the paper on the CoreXY mechanism."""
