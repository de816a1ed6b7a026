"""The mission file, the phase tables and the controller core. No I/O, no clock."""
