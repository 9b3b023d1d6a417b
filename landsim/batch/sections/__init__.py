"""The sections of a summary, each a pure function of the scenario and its flights.

::

    rates          how often, with intervals, and what n can and cannot show
    verdict        room to each limit, what nobody was warned of, go-arounds, navigation's word against the truth
    touchdown      where, with ellipses
    distributions  how well: quantiles, histograms, exceedance
    tracking       deviation from the glide slope and the centreline, beside published criteria
    envelopes      navigation errors by distance, beside the paper's bounds and published limits
    consistency    normalised errors against their bounds, coverage of the predicted 95 %
    sensitivity    which draws matter, by rank correlation
    worst          the flights nearest to a limit, or beyond it
    words          numbers as sentences, tables and figures have them
"""
