"""Which known mistake in Eq. 8 or free flight gives a solver's answers: every one of a table is flown and compared."""
