"""What holding the coefficients constant over a step costs, step by step."""
