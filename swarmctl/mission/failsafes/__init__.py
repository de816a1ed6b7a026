"""The vehicles' own failsafes: they must bring the swarm home safely and apart without swarmctl.

===============  ================================================================================
``rules``        what a rule may say of a parameter, and the kinds of rules
``ardupilot``    the table of rules for ArduCopter
``px4``          the table of rules for PX4
``judge``        applies the tables to what the vehicles have told, and compares their returns
``session``      reads the parameters before a flight, sets them with consent, restores them after
===============  ================================================================================
"""
