"""What each engine says of its own run of the throw: how far omega(t) may be off."""
