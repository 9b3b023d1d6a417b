"""Many flights of one scenario: rows of numbers, who flies them, and what follows from them.

::

    row                  one flight as a row: the pure function of scenario and seed
    rows                 rows as Parquet
    pool                 processes that fly, as an executor; process is one of them, worker the far end of its pipes
    cluster              the same on Dask
    job, engine          one flight to do; flights through any executor, a bounded number at a time
    identity             what makes two batches the same
    deferred             interrupts that wait until nothing is held
    chunks, gather       results as they come, and all of them in order; durable writes what must not be lost
    folder               a batch's folder: begun, resumed, finished
    merge, replay        shards to one batch; one flight again
    verify               a table of flights against the batch that it is said to be of
    flights              the flights of a batch as columns
    measures, published  what a flight is judged by; published limits, with sources
    stats, ellipse       intervals, bounds, rank correlation; where the next touchdown will be
    sections, summary    the numbers of a report, section by section
    paired, compare      differences over common seeds; batches side by side
"""
