"""A flight's recording: MAVLink log, MCAP of all records, debrief, summary and plots."""
