"""Where the companions stand, how the swarm moves there, and what no command may break.

Pure functions of positions, angles and limits. Frames: ENU, metres; angles theta from the
line of sight (LOS), counter-clockwise; LOS angle lambda from East.
"""
