"""The CoreXY motion system with dry friction, a machine built on `stickslip`."""

# The engine also switches JAX to 64-bit floating point, which must come before any array is made.
import stickslip as _stickslip  # noqa: F401
