"""The measurement feed: range differences over MQTT, and the estimate going out the same way."""
