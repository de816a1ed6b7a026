"""Bytes to messages and back: the only modules that know pymavlink."""
