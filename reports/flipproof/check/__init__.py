"""A throw held to a report, two reports held together, two solvers compared."""
