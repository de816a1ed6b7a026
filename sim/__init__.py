"""The simulated truth, independent of the controller: what is really there and what it sends.

World and vehicles
    ``world`` (all of it on one virtual clock), ``vehicle`` (one UAV), ``dynamics`` (how it moves),
    ``wind``, ``faults``, ``navigation_errors`` (GPS), ``vehicle_clock``, ``autopilots``.
Emitter and receivers
    ``emitter`` (its drift), ``receivers``, ``receiver_errors`` (noise, clocks, echoes),
    ``feed_publisher`` (what goes over MQTT), ``sitl_receivers`` (receivers on vehicles that others
    simulate).
Around them
    ``config`` (what a simulation is made of), ``noise`` (random draws), ``mavlink`` (codec),
    ``radio_channel`` (loss and delay), ``serve`` (UDP and MQTT), ``indoor_dataset`` (a TDOA data
    set of a room).
"""
