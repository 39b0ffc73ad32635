"""Figures of the paper on the block on a belt with a normal-force pendulum and a DC drive."""
