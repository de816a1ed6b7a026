"""Recording a flight: MAVLink log, MCAP of everything the core saw and decided, debrief."""
