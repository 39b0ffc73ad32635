"""The electro-mechanical positioning system of the nonlinear benchmarks: a carriage on a ball screw."""
