"""Studies: each plans the runs it needs, and turns their trajectories into data. Nothing here draws or prints."""
