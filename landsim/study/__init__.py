"""Studies: the estimator's errors by sampling, and by flights, against the bounds that a paper states.

::

    model         quantities, bounds and the arrays that pass between the modules
    frames        the straight approach: where the camera is, and what it sees without noise
    draws         noisy points, through the line fit, to poses and their errors
    envelope      errors by range: percentiles, first-order sigma, a single realisation
    holding       the range from which a bound holds
    precision     the line precision with which a bound holds
    flights       the same approach flown in JSBSim, by vision alone
    translations  the position by coplanarity against that by a single point
    peers         lines against corner points of the same images; solvers are other libraries' solutions
    tilt          errors against the camera's tilt
    timing        time a frame
    geometry      what ties errors together: range to angle, and what a roll error does late
    judged        envelopes against bounds; evidence is what stands beside them
    verdict       what holds, as data; paragraphs in words, markdown as a page
    plan          what a study looks at, and whether it can
    run           a whole study, cut into tasks; tasks does them in processes
    folder        what is kept of it
"""
