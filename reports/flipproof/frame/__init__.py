"""What every subject of a report shares: runs, the pool that makes them, stages, findings, exhibits."""
