"""What more slices would change: the same throw, damping rate alpha/2m unchanged, cut finer and finer."""
