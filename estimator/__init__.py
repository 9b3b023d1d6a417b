"""From image lines of a runway to a fused pose.  This page states the conventions, once; everything else keeps to them.

Frames
------
runway
    Origin at the middle of the threshold, x along the centreline in the landing direction, y right, z down.  Fixed to
    the Earth. Height above the runway is -z.  The edges lie at y = -width/2 (left) and y = +width/2 (right), from x = 0
    on; the threshold at x = 0.
body
    Forward, right, down from the inertial unit, which sits at the centre of gravity.
camera
    x right, y down, z along the optical axis, from the projection centre.
camera triad
    Forward (the optical axis), right, down: the camera frame's z, x, y.

Signs
-----
Attitude is roll, pitch, yaw of a triad (forward, right, down) relative to the runway frame, intrinsic z-y-x: yaw first,
then pitch, then roll. Nose right, nose up and right side down are positive.  In the image, nose up moves the runway
down, nose right moves it left, and right side down turns it anticlockwise.
The mount's tilt is positive where the optical axis points below the body's x axis.

Pixels: u right, v down, origin at the centre of the top-left pixel, principal point (cx, cy).  A line a u + b v + c = 0
may have any scale and sign.

Errors are true less estimated.  That of an attitude is a rotation vector ψ in the runway frame: R_true = exp([ψ×])
R_estimated.

Units and names
---------------
SI and radians, without a suffix.  Anything else carries its unit: ``_px``, ``_deg``.  Transforms are ``b_from_a``, so
in a product the names that touch must match: ``R_cam_from_body @ R_body_from_runway``.  Points say their frame:
``threshold_in_cam``.

Modules
-------
so3                 rotations on tuples of floats
compiled            what runs at every step and frame; not imported from here, since numba takes half a second
camera              pinhole camera: projection, clipping, the planes of image lines
lines               total least squares through edge points, with the line's covariance
three_line          early stage: pose from both edges and the threshold
two_line            late stage: yaw, pitch, lateral position and height from both edges and a roll angle
covariance          first-order covariance of either pose
strapdown           inertial mechanisation and its error model
pose                what the two solvers return
mount               how the camera sits on the body
innovation          a camera frame as a measurement of the filter's errors
alignment           the start of the filter
single_lines        each line by itself as a measurement, also of the camera's calibration
fusion              the filter; not imported from here, since filterpy takes a second to import
line_fusion         the filter of single lines, with calibration and scale factors in its state; likewise

The measurement that the filter takes from a frame is the vision pose less the predicted one, to first order in the
lines at the predicted pose: two or three lines and the four or six numbers of the pose fix one another there, and the
lines are where the noise is Gaussian.

The solvers are those of F. Li, D. Tang, N. Shen, "Vision-based pose estimation of UAV from line correspondences",
Procedia Engineering 15 (2011) 578-584, doi:10.1016/j.proeng.2011.08.109.
"""

from estimator.camera import PinholeCamera
from estimator.covariance import LineNoise, three_line_covariance, two_line_covariance
from estimator.lines import LineFit, fit_line
from estimator.pose import ThreeLinePose, TwoLinePose
from estimator.three_line import three_line_pose
from estimator.two_line import two_line_pose

__all__ = [
    "LineFit",
    "LineNoise",
    "PinholeCamera",
    "ThreeLinePose",
    "TwoLinePose",
    "fit_line",
    "three_line_covariance",
    "three_line_pose",
    "two_line_covariance",
    "two_line_pose",
]
