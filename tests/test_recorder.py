"""What the recorder works out when a flight is over.

====================  ============================================================================================
normalised squares    numpy's inverse; a matrix that is no covariance
====================  ============================================================================================
"""

import numpy as np
from numpy.random import default_rng

from landsim.recorder import normalised_squares


def test_normalised_squares() -> None:
    rng = default_rng(1)
    scale = 10.0 ** rng.uniform(-6.0, 2.0, 15)
    root = rng.normal(size=(4, 15, 15))
    covariance = root @ np.swapaxes(root, 1, 2) * np.outer(scale, scale)
    error = scale * rng.normal(size=(4, 15))
    covariance[2, 9, 9] *= -1.0
    nine, fifteen = normalised_squares(error, covariance, 9)
    for i in (0, 1, 3):
        for got, k in ((nine[i], 9), (fifteen[i], 15)):
            part = covariance[i, :k, :k] / np.outer(scale[:k], scale[:k])
            of = error[i, :k] / scale[:k]
            np.testing.assert_allclose(got, of @ np.linalg.inv(part) @ of, rtol=1e-6)
    assert np.isnan((nine[2], fifteen[2])).all()
