"""The sockets and serial lines behind the link's URLs. They move bytes and decide nothing.

``url`` says what may be asked for, ``udp`` and ``stream`` open it, ``opening`` chooses.
"""
