"""From messages to rows: positions aligned with measurements, arrival times paired."""
