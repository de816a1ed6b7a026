"""Where the companions stand, how the swarm moves there, and what no command may break.

Pure functions of positions, angles and limits. Frames: ENU, metres; angles theta from the
line of sight (LOS), counter-clockwise; LOS angle lambda from East.

==================  =========================================================================
``requirements``    what a formation has to satisfy, and the noise it is to overcome
``information``     the Fisher information of range differences on the emitter's position
``objectives``      what a design is judged by, in metres
``designs``         designs by name
``optimal``         numerical refinement
``report``          what a design is worth, compared with the others
``pictures``        the picture of it
``book``            designs made before a flight, chosen in flight
``slots``           from a design to slots in space, and who takes which
``guidance``        the LOS, and the reference UAV's velocity
``dogleg``          whether to approach at an angle to the LOS for a while
``constraints``     stand-off, geofence, limits; the judgement of a plan
``separation``      plans that keep apart
==================  =========================================================================
"""
