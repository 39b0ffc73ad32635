"""Objects that show themselves: their numbers with units, in text and in notebooks.

For packages that are built on this one.
"""

from ._show import AbstractShown as AbstractShown
