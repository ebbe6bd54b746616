"""Free flight by several solvers: who agrees with whom, each within its own band."""
