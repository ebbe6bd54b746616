"""A measured flight beside the solvers."""
