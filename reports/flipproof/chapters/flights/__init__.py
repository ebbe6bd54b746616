"""The flights: every solver on the throw, the flights that are drawn, and the moving bottles."""
