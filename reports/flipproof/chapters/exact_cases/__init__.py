"""The reference against every case that has an exact solution: nothing finer is claimed of it."""
