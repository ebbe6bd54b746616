"""Studies, claims, figures, the page and the command line: everything that looks at trajectories."""

from flipproof.frame.others import OTHERS

OTHERS.append("flipproof.foreign.solving")
