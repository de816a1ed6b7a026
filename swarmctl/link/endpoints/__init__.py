"""The sockets and serial lines behind the link's URLs. They move bytes and decide nothing.

``url`` reads the URLs, ``udp`` and ``stream`` open endpoints of each kind, ``opening`` opens all of
a ground station's.
"""
