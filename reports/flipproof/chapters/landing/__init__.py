"""Does it stand? The landing: P(upright) over the filling, for water and ice, under two laws of the impact."""
