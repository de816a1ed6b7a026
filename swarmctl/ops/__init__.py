"""Running a mission: the shell that joins core, link, feed and recorder, live or in memory.

The only room that imports ``sim``, and lazily: a controller in the field never loads it.
"""
