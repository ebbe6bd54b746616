"""What a digit costs: error against cost, every contender against its own equation."""
