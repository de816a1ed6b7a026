"""Where the companions stand, how the swarm moves there, and what no command may break.

Pure functions of positions, angles and limits. Frames: ENU, metres; angles theta from the
line of sight (LOS), counter-clockwise; LOS angle lambda from East.

==================  =========================================================================
``requirements``    what a design has to satisfy, and the noise of the range differences
``information``     the Fisher information of range differences on the emitter's position
``objectives``      functions that judge designs, in metres
``designs``         the designs by name: optimal, paper, uniform, regression, worst case
``design_search``   the numerical search behind the optimal and the worst-case design
``design_report``   the predicted accuracy of a design, and how the designs compare
``design_choice``   the designs of a flight, made before it and chosen in it
``slots``           from a design to slots in space, and which companion takes which
``guidance``        turning the formation with the LOS; the reference UAV's velocity field
``dogleg``          whether to approach at an angle to the LOS for a while
``flight_limits``   stand-off, geofence, d_max, ceiling: bending velocities, judging a plan
``separation``      planned velocities that keep the vehicles apart
==================  =========================================================================
"""
