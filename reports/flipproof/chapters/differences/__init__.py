"""Where and when the solvers part: pairs of flights of the throw, down the ladder one assumption at a time."""
