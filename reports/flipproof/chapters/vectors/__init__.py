"""The published programs' printed numbers are reproduced, in every column and over the whole run."""
