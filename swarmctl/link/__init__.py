"""The controller's side of MAVLink.

``codec`` turns bytes into facts and commands into bytes (the only importer of pymavlink),
``autopilots`` holds the manners of each flight stack, ``exchange`` brings one command at a
time through a lossy link, ``clock`` maps a vehicle's boot time to UTC, ``statistics`` counts
losses, ``signing`` believes or refuses, ``forward`` routes to other stations, ``channels`` keeps
the addresses. ``link`` puts them together without any I/O; ``endpoints`` are the sockets.
"""
