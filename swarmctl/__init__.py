"""swarmctl: a MAVLink swarm mission controller that finds a radio emitter by TDOA.

Conventions, fixed once here and used by every room of the package.

Units
    SI units and radians inside; degrees, 1e7-degrees, milliseconds and the like exist only
    at the edges (the mission file, ``link/decoding`` and ``link/encoding``, the console). A name
    carries its unit where a reader could doubt it: ``_m``, ``_mps``, ``_s``, ``_rad``, ``_hz``.

Frames
    ``_enu``: east, north, up in metres in the tangent plane at the mission origin
    (:class:`swarmctl.frames.LocalFrame`). Altitudes named ``alt_amsl_m`` are above mean sea
    level, on the wire and in the mission file; no vehicle's home-relative frame is ever used.
    The geoid is taken as the WGS-84 ellipsoid on both sides of the wire.

Angles
    The line-of-sight (LOS) angle lambda is measured from East, counter-clockwise. A formation
    angle theta is measured from the LOS, counter-clockwise, as in the paper.

Time
    ``now`` and every name ending in ``received_s``: monotonic seconds of the controller's
    clock, used for deadlines. ``epoch_utc_s``: seconds of UTC (float64, resolution 0.24 us),
    used for measurements. Both are passed in; nothing in the core reads a clock.

Randomness
    Generators are passed in (:class:`numpy.random.Generator`), never global.

Symbols
    UAV 0 of the paper is the *reference*, UAVs 1..N its *companions*. A range difference
    (RD) is ``r_j = D_j - D_0``: range emitter-companion minus range emitter-reference.
"""

from __future__ import annotations

__version__ = "0.1.0"
