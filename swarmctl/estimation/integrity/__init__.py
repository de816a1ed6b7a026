"""Whether measurements and the track may be believed: gate, repetition, health."""
