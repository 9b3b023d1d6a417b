"""Every conversion factor of the project: multiply by the factor to reach SI.

``12.0 * FT`` is twelve feet in metres, ``speed / KT`` is a speed in knots.  The exact definitions are those of
NIST SP 811 (2008), appendix B; the kilogram per slug follows from lbf, ft and the standard acceleration.
"""

import math

DEG = math.pi / 180.0
"""rad per degree."""
MM = 1e-3
"""m per millimetre."""
UM = 1e-6
"""m per micrometre."""
INCH = 0.0254
"""m per inch (exact)."""
FT = 0.3048
"""m per foot (exact)."""
KT = 1852.0 / 3600.0
"""m/s per knot (exact)."""
STANDARD_GRAVITY = 9.80665
"""m/s² per g (exact); a unit, not the gravity of any site."""
LB = 0.45359237
"""kg per pound mass (exact)."""
LBF = LB * STANDARD_GRAVITY
"""N per pound force (exact)."""
SLUG = LBF / FT
"""kg per slug."""
HP = 550.0 * FT * LBF
"""W per mechanical horsepower."""
KELVIN_IN_RANKINE = 1.8
"""Degrees Rankine per kelvin, of differences (exact)."""
HPA_IN_PSF = 100.0 * FT**2 / LBF
"""Pounds per square foot per hectopascal."""
HOUR = 3600.0
"""s per hour."""
MILLI_G = 1e-3 * STANDARD_GRAVITY
"""m/s² per milli-g."""
DEG_PER_HOUR = DEG / HOUR
"""rad/s per degree per hour."""
DEG_PER_SQRT_HOUR = DEG / math.sqrt(HOUR)
"""rad/√s per degree per root hour (angle random walk)."""
MPS_PER_SQRT_HOUR = 1.0 / math.sqrt(HOUR)
"""m/s/√s per metre per second per root hour (velocity random walk)."""
