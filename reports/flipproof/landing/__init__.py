"""Does it stand? Throws that scatter, landed by the thousand, and what share of them ends upright."""
