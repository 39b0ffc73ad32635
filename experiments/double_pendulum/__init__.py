"""A double pendulum with a motor in each joint: its inertia and friction from measured motions."""
