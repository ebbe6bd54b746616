"""The figures of the report, one module per subject: data in, a matplotlib Figure out."""
