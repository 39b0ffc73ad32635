"""The viewer behind `python -m stickslip view`: a diagram whose points are clicked."""
