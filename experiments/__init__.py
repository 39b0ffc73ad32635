"""Each figure of the papers is a file here and a command: `python -m experiments --list`."""
