"""Error against step size: each scheme against the equation that it converges to."""
