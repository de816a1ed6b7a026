"""What the vehicles do by themselves: parameters read, judged, set and restored."""
