"""Bench ``motion``: games of random moves, their laws against the optimum, and the standard cycle."""
