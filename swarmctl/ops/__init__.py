"""Runs a mission: joins core, link, feed and recorder, live or in memory.

Only this room and the studies import ``sim``; a controller in the field never loads it.
"""
