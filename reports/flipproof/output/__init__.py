"""What a report leaves behind: folder, tables, summary with its schema, JUnit, provenance, snapshot."""
