"""Numbers of the engine, changed for a test."""

import dataclasses
import sys

from stickslip.hybrid.accuracy import ACCURACY


def set_accuracy(monkeypatch, *modules, **changes):
    """Let these modules, or all, see `ACCURACY` with these changes until the test ends."""
    changed = dataclasses.replace(ACCURACY, **changes)
    for module in modules or list(sys.modules.values()):
        if getattr(module, "ACCURACY", None) is ACCURACY:
            monkeypatch.setattr(module, "ACCURACY", changed)
