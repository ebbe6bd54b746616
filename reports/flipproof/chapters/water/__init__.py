"""Which equation comes nearest to water, by filling."""
