"""Studies, claims, figures, the page and the command line: everything that looks at trajectories."""
