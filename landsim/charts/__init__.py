"""Charts as data: what the figures of a batch and of a comparison show, made from their summaries alone.

::

    model        chart, panels, axes, series
    batch        the charts of a batch, by section of its report
    landing      how often it landed, where and how well
    navigation   errors by range, consistency of the filter, which draws matter
    comparison   the charts of batches side by side
    shared       numbers in words, rates and shares as series
    extent       where axes end and names of limits go, for every renderer
"""
