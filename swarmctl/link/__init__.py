"""The controller's side of MAVLink.

A station sees a ``vehicle_link``: events in, commands out, a timer. ``mavlink_link`` speaks MAVLink
itself, and its bytes go through a ``datagram_port``; ``mavsdk_link`` lets MAVSDK speak. What both
share is in ``link_base``, and what they keep of one vehicle in ``vehicle_session``.

``codec`` turns bytes into messages and back. ``autopilots`` knows how each flight stack is asked.
``command_protocol``, ``parameter_protocol`` and ``fence_upload`` bring commands, parameters and
fences through a lossy link. ``vehicle_roster`` knows which vehicle speaks from where,
``vehicle_clock`` maps its time to UTC, ``link_quality`` counts losses, ``signing`` checks
signatures, ``forwarding`` routes to other ground stations. None of these does I/O; ``endpoints``
holds the sockets.
"""
