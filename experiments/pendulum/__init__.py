"""A free pendulum on its bearing: which friction a decaying swing shows."""
