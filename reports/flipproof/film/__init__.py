"""One's own videos: the tracker's exports read, and parameters fitted to them."""
