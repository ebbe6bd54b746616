"""Where pymunk is stable, and where it is right: the chart of step against iterations."""
