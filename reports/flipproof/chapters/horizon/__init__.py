"""Up to when an engine's omega(t) means anything: ensembles of flights that should be one flight."""
