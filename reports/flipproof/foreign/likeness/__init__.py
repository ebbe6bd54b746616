"""Which known mistake in its equation gives a solver's answers: every one of a table is flown and compared."""
