"""Monte Carlo studies of estimators: the paper's Table 1, consistency, information.

The only room that knows both the truth and the estimators. ``swarmctl study`` runs these
studies; all parts are public (``docs/how-to/study-a-filter.md``).

==================  =========================================================================
``engagement``      the engagement of Table 1: who is where, and what is measured
``starts``          what is drawn before a run begins: the prior, the truth
``registry``        filters and formations by name; a researcher adds his own
``campaign``        runs x formations x filters, in chunks, on any executor
``executors``       this process, several, or a dask cluster
``tally``           what is kept of the runs: sums, and the statistics made of them
``table1``          the paper's Figs. 2-9, with the bound it did not draw
``consistency``     error against the bound, and NEES, with confidence intervals
``tracker``         the live tracker on everything that white noise is not
``tracker_cases``   what it is tried on, and held to
``tracking``        chunks of runs with it
``receivers``       clocks, navigation errors, coloured errors and echoes, drawn
``health``          does it say so when its model is wrong?
``information``     Appendices A and B: does the NCRKF's information converge to the OKF's?
``formation``       whole missions: which formation finds the emitter soonest?
``figures``         pictures of the above
``jsonable``        results as JSON
==================  =========================================================================
"""
