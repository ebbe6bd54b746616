"""Step size or another equation: what stays of a scheme's error as its step goes to zero."""
