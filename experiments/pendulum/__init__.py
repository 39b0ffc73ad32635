"""A free pendulum on its bearing: which friction a decay of the swing tells."""
