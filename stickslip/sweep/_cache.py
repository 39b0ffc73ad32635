"""Where what may be lost is kept between processes: verdicts of trials, compiled programs."""

import os
import pathlib


def cache_directory() -> pathlib.Path:
    """`STICKSLIP_CACHE`, else `stickslip` in the user's cache directory; it need not exist."""
    own = os.environ.get("STICKSLIP_CACHE")
    if own:
        return pathlib.Path(os.path.abspath(os.path.expanduser(own)))
    root = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return pathlib.Path(os.path.abspath(root)) / "stickslip"
