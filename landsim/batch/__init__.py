"""Many flights of one scenario: rows of numbers, and what follows from them.

::

    row    one flight as a row: the pure function of scenario and seed
    rows   rows as Parquet
    pool   processes that fly, and rows from any executor
"""
