"""The controller's side of MAVLink.

``framing`` finds the frames in what arrives, ``decoding`` turns them into facts and ``encoding``
commands into frames (only these three import pymavlink); ``facts`` holds the words they share.
``autopilots`` holds the manners of each flight stack, ``exchange`` brings one command at a
time through a lossy link, ``parameters`` and ``fence`` bring theirs, ``clock`` maps a vehicle's
boot time to UTC, ``statistics`` counts losses, ``signing`` believes or refuses, ``forward``
routes to other stations, ``channels`` keeps the addresses. ``vehicle`` holds all that concerns one
vehicle, ``roster`` knows who is one and where. ``link`` puts them together without any I/O;
``endpoints`` are the sockets.
"""
