"""The same system with fields beside it, for sections and integrands to read."""

from ._wrapper import AbstractSystemWrapper


class AbstractSameSystem(AbstractSystemWrapper):
    """A system with the state, the arguments and the motion of `system`.

    A subclass adds fields. A section or an integrand, which is given the simulated system, reads
    them there, so that they are operands of the program and not parts of it.
    """

    def inner(self, y, args):
        """State and arguments as they are."""
        return y, args

    def vector_field(self, t, y, mode, args):
        return self.system.vector_field(t, y, mode, args)

    def transition(self, t, y, mode, guard, args):
        return self.system.transition(t, y, mode, guard, args)
