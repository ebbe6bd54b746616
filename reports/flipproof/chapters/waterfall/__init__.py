"""What each assumption costs: the difference from the published program to free flight, split."""
