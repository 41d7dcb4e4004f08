"""Kinematics of the delta arm: (1), (3), (7), the closed form, the inverse, and the Jacobians (11)-(14).

Three unit vectors of arm i, in the base frame, carry everything:

* d_i along the distal link, R_i (sin q2 sin q3, cos q2, sin q2 cos q3);
* e_i in which the elbow moves, R_i (0, -sin q1, cos q1);
* psi_i = R_i (0, l0 - l3 + l1 cos q1, l4 + l1 sin q1) + l2 d_i, the tool point as arm i sees it, eq. (1).

d_i, a_i = ∂d_i/∂q2 and n_i = (∂d_i/∂q3) / sin q2 are orthonormal; most formulas below are that fact used once.

All of it is compiled, allocates nothing and returns a `Status` as int; `controller.model.reach` raises instead.
"""

import math
from enum import IntEnum
from typing import Final

from controller.model.compiled import FloatArray, Vector, compiled
from controller.model.constants import DISTAL, HEIGHT, PROXIMAL, RADIUS
from controller.model.vectors import combine, common_point, cross, distance, dot, minus, scaled, turn, turn_back

Triad = tuple[Vector, Vector, Vector]


class Status(IntEnum):
    """How a computation in the loop ended."""

    OK = 0
    SINGULAR = 1
    """The pose is too near a kinematic singularity, or beyond it."""
    NOT_CONVERGED = 2
    """Newton's iteration did not close the chain."""
    UNREACHABLE = 3
    """No pose of the arm fits the input."""


# Enum members are objects to Numba; plain integers compile to constants.
OK: Final = int(Status.OK)
SINGULAR: Final = int(Status.SINGULAR)
NOT_CONVERGED: Final = int(Status.NOT_CONVERGED)
UNREACHABLE: Final = int(Status.UNREACHABLE)

TOLERANCE: Final = 1e-10
"""Largest distance left between the arms' tool points, |h| of (3) [m]."""
MAX_ITERATIONS: Final = 12
"""Newton steps before giving up; from tick to tick one or two suffice."""
MIN_DETERMINANT: Final = 1e-3
"""Smallest volume spanned by d_1, d_2, d_3 (0: parallel singularity); 0.93 at the board's centre."""
MIN_TRANSMISSION: Final = 1e-2
"""Smallest d_i·e_i (0: arm stretched, a servomotor moves the tool no more); 0.95 at the board's centre."""
MIN_SINE: Final = 1e-6
"""Smallest sin q2: the universal joint's angles degenerate at 0."""


@compiled
def elbow(constants: FloatArray, arm: int, q1: float) -> tuple[Vector, Vector]:
    """The elbow, shifted by flange and gripper so that psi_i = elbow + l2 d_i [m], and e_i; base frame."""
    c, s, l1 = math.cos(q1), math.sin(q1), constants[PROXIMAL]
    centre = turn(arm, (0.0, constants[RADIUS] + l1 * c, constants[HEIGHT] + l1 * s))
    return centre, turn(arm, (0.0, -s, c))


@compiled
def triad(arm: int, q2: float, q3: float) -> Triad:
    """Orthonormal d_i, a_i = ∂d_i/∂q2 and n_i = (∂d_i/∂q3) / sin q2, base frame."""
    c2, s2, c3, s3 = math.cos(q2), math.sin(q2), math.cos(q3), math.sin(q3)
    d = turn(arm, (s2 * s3, c2, s2 * c3))
    a = turn(arm, (c2 * s3, -s2, c2 * c3))
    return d, a, turn(arm, (c3, 0.0, -s3))


@compiled
def arm_tool_point(constants: FloatArray, arm: int, q1: float, q2: float, q3: float) -> Vector:
    """psi_i of eq. (1): the tool point from one arm's angles [m], base frame."""
    return combine(elbow(constants, arm, q1)[0], constants[DISTAL], triad(arm, q2, q3)[0])


@compiled
def elbows(constants: FloatArray, y: FloatArray) -> tuple[Triad, Triad]:
    """All three of `elbow`: where they are [m] and in which directions they move, for y, shape (3,) [rad]."""
    c1, e1 = elbow(constants, 0, y[0])
    c2, e2 = elbow(constants, 1, y[1])
    c3, e3 = elbow(constants, 2, y[2])
    return (c1, c2, c3), (e1, e2, e3)


@compiled
def distal_directions(constants: FloatArray, centres: Triad, z: Vector) -> Triad:
    """(d_1, d_2, d_3) from elbows [m] and tool point z [m]; base frame."""
    s = 1.0 / constants[DISTAL]
    return scaled(s, minus(z, centres[0])), scaled(s, minus(z, centres[1])), scaled(s, minus(z, centres[2]))


@compiled
def newton_step(constants: FloatArray, y: FloatArray, x: FloatArray) -> tuple[int, float]:
    """One Newton step of (7), in place, by one 3x3 system in place of the paper's 6x6.

    Write z = psi_i + l2 (a_i δq2 + sin q2 n_i δq3) for the tip of arm i in the linearised model. (7) says that the
    three tips agree: psi_1 + ... = psi_2 + ... = psi_3 + ..., so there is one z with l2 (a_i δq2 + sin q2 n_i δq3) = z
    - psi_i for all i. d_i is orthogonal to a_i and n_i, hence d_i·z = d_i·psi_i: three equations for z. Multiplying by
    a_i and n_i instead gives δq2 = a_i·(z - psi_i) / l2 and δq3 = n_i·(z - psi_i) / (l2 sin q2). The nine equations are
    equivalent to these nine, so the step is exactly that of (7), and ∂h/∂x is singular exactly where det [d_1; d_2;
    d_3] or a sin q2 vanishes.

    From servomotor angles y, shape (3,), the unmeasured x, shape (6,), are improved in place [rad]. Returns status and
    the residual |h| before the step [m]; with one within `TOLERANCE` x closes the chain already, and no step is taken.
    """
    l2 = constants[DISTAL]
    d1, a1, n1 = triad(0, x[0], x[1])
    d2, a2, n2 = triad(1, x[2], x[3])
    d3, a3, n3 = triad(2, x[4], x[5])
    p1 = combine(elbow(constants, 0, y[0])[0], l2, d1)
    p2 = combine(elbow(constants, 1, y[1])[0], l2, d2)
    p3 = combine(elbow(constants, 2, y[2])[0], l2, d3)
    first, second = distance(p1, p2), distance(p1, p3)
    residual = max(first, second) + 0.0 * (first + second)  # a maximum may overlook a NaN
    if residual <= TOLERANCE:
        return OK, residual
    determinant, z = common_point(d1, d2, d3, (dot(d1, p1), dot(d2, p2), dot(d3, p3)))
    s1, s2, s3 = l2 * math.sin(x[0]), l2 * math.sin(x[2]), l2 * math.sin(x[4])
    if abs(determinant) < MIN_DETERMINANT or min(abs(s1), abs(s2), abs(s3)) < l2 * MIN_SINE:
        return SINGULAR, residual
    x[0] += dot(a1, minus(z, p1)) / l2
    x[1] += dot(n1, minus(z, p1)) / s1
    x[2] += dot(a2, minus(z, p2)) / l2
    x[3] += dot(n2, minus(z, p2)) / s2
    x[4] += dot(a3, minus(z, p3)) / l2
    x[5] += dot(n3, minus(z, p3)) / s3
    return OK, residual


@compiled
def forward_kinematics(constants: FloatArray, y: FloatArray, x: FloatArray) -> tuple[int, int]:
    """Newton's iteration (7) from a warm start to |h| <= 1e-10 m, for y, shape (3,) [rad]; status and number of steps
    taken.

    It stays on the branch of its start if that is near; `spheres_meet` gives a cold start. ``x``, shape (6,), is in:
    the last solution; out: the unmeasured angles [rad].
    """
    for steps in range(MAX_ITERATIONS + 1):
        status, residual = newton_step(constants, y, x)
        if residual <= TOLERANCE:
            return OK, steps
        if status != OK:
            return status, steps
    return NOT_CONVERGED, MAX_ITERATIONS


@compiled
def tool_point_near(constants: FloatArray, centres: Triad, z: Vector) -> tuple[int, int, Vector, Triad]:
    """Newton's iteration (7) from a tool point a moment ago [m], without angles: what the loop uses.

    In (7) x serves only to say where the distal links point. Let them point at z: d_i = (z - elbow_i) / |z - elbow_i|.
    The step of (7) is then the point that the planes d_i·z = d_i·elbow_i + l2 have in common, see `newton_step`, and no
    sine is needed. It lies within |w_i|² / (2 l2) of sphere i, where w_i leads to it from elbow_i + l2 d_i along the
    plane, so that |z - elbow_i|² = l2² + |w_i|²: how far the chain is closed is known without another step. The
    iteration ends with |h| <= 1e-10 m.

    Centres are of the elbows [m], see `elbows`. Returns the status, the number of steps taken, the tool point [m] and
    the distal directions.
    """
    l2 = constants[DISTAL]
    steps = 0
    while True:
        r1, r2, r3 = minus(z, centres[0]), minus(z, centres[1]), minus(z, centres[2])
        n1, n2, n3 = math.sqrt(dot(r1, r1)), math.sqrt(dot(r2, r2)), math.sqrt(dot(r3, r3))
        d1, d2, d3 = scaled(1.0 / n1, r1), scaled(1.0 / n2, r2), scaled(1.0 / n3, r3)
        if abs(n1 - l2) + abs(n2 - l2) + abs(n3 - l2) <= TOLERANCE:  # a sum, as a maximum may overlook a NaN
            return OK, steps, z, (d1, d2, d3)
        if steps == MAX_ITERATIONS:
            return NOT_CONVERGED, steps, z, (d1, d2, d3)
        planes = (dot(d1, centres[0]) + l2, dot(d2, centres[1]) + l2, dot(d3, centres[2]) + l2)
        determinant, z = common_point(d1, d2, d3, planes)
        if abs(determinant) < MIN_DETERMINANT:
            return SINGULAR, steps, z, (d1, d2, d3)
        steps += 1
        w1, w2, w3 = minus(z, centres[0]), minus(z, centres[1]), minus(z, centres[2])
        if dot(w1, w1) + dot(w2, w2) + dot(w3, w3) - 3.0 * l2 * l2 <= l2 * TOLERANCE:
            return OK, steps, z, (scaled(1.0 / l2, w1), scaled(1.0 / l2, w2), scaled(1.0 / l2, w3))


@compiled
def spheres_meet(constants: FloatArray, y1: float, y2: float, y3: float) -> tuple[int, Vector]:
    """The tool point z [m], base frame, in closed form, with its status: where three spheres of radius l2 about the
    elbows meet.

    The centre of the elbows' circumcircle plus a way along its normal, to the side on which the tool hangs below level
    elbows: det [d_1; d_2; d_3] is negative there, however the plane is tipped, and Newton stays on that side. The paper
    says that no closed form exists; for arms whose rods keep the flange from turning it does. SINGULAR: elbows in one
    line. UNREACHABLE: the spheres do not meet.
    """
    c1, c2, c3 = elbow(constants, 0, y1)[0], elbow(constants, 1, y2)[0], elbow(constants, 2, y3)[0]
    u, v = minus(c2, c1), minus(c3, c1)
    normal = cross(u, v)
    square = dot(normal, normal)
    if not square > 0.0:
        return SINGULAR, c1
    uu, vv = dot(u, u), dot(v, v)
    across_u, across_v = cross(v, normal), cross(normal, u)
    centre = combine(combine((0.0, 0.0, 0.0), uu / (2.0 * square), across_u), vv / (2.0 * square), across_v)
    height = constants[DISTAL] * constants[DISTAL] - dot(centre, centre)
    if not height >= 0.0:
        return UNREACHABLE, c1
    # z3 points down and the arms follow each other clockwise, so the normal of level elbows points up
    return OK, combine(combine(c1, 1.0, centre), -math.sqrt(height / square), normal)


@compiled
def distal_angles(constants: FloatArray, arm: int, q1: float, z: Vector) -> tuple[float, float]:
    """q2 in (0, π) and q3 of an arm whose elbow and tool point are known [rad]."""
    w = turn_back(arm, minus(z, elbow(constants, arm, q1)[0]))
    return math.atan2(math.hypot(w[0], w[2]), w[1]), math.atan2(w[0], w[2])


@compiled
def inverse_arm(constants: FloatArray, arm: int, z: Vector) -> tuple[int, float]:
    """q1 of one arm, outward branch, for a tool point [m]: status (OK or UNREACHABLE) and q1 [rad].

    In the plane of the arm's motion the elbow lies at distance l1 from the shoulder and at √(l2² - w1²) from the tool
    point w (seen from the shoulder): w2 cos q1 + w3 sin q1 = (|w|² + l1² - l2²) / (2 l1).
    """
    l1, l2 = constants[PROXIMAL], constants[DISTAL]
    w = minus(turn_back(arm, z), (0.0, constants[RADIUS], constants[HEIGHT]))
    ratio = (dot(w, w) + l1 * l1 - l2 * l2) / (2.0 * l1 * math.hypot(w[1], w[2]))
    if not abs(ratio) <= 1.0:
        return UNREACHABLE, 0.0
    q1 = math.atan2(w[2], w[1]) - math.acos(ratio)
    return OK, q1 if q1 > -math.pi else q1 + 2.0 * math.pi


@compiled
def inverse_kinematics(constants: FloatArray, z: Vector, y: FloatArray, x: FloatArray) -> tuple[int, int]:
    """All angles for a tool point z [m], outward branch; fills y, shape (3,), and x, shape (6,) [rad].

    Returns status and, if UNREACHABLE, the first arm (0, 1, 2) that does not reach.
    """
    for arm in range(3):
        status, q1 = inverse_arm(constants, arm, z)
        if status != OK:
            return status, arm
        y[arm] = q1
        x[2 * arm], x[2 * arm + 1] = distal_angles(constants, arm, q1, z)
    return OK, 0


@compiled
def arm_directions(constants: FloatArray, y: FloatArray, z: Vector) -> tuple[Triad, Triad]:
    """(d_1, d_2, d_3) and (e_1, e_2, e_3) from servomotor angles y, shape (3,) [rad], and their tool point z [m]."""
    centres, e = elbows(constants, y)
    return distal_directions(constants, centres, z), e


@compiled
def control_jacobian(
    constants: FloatArray, d: Triad, e: Triad, jacobian: FloatArray, inverse: FloatArray
) -> tuple[int, float, float]:
    """J_c = ∂z/∂y of (13) [m/rad] and its inverse [rad/m], out, shape (3, 3) each: d_i·ż = l1 (d_i·e_i) ẏ_i.

    So J_c⁻¹ has the rows d_iᵀ / (l1 d_i·e_i), and J_c the columns l1 (d_i·e_i) (d_j × d_k) / det [d_1; d_2; d_3]. d are
    unit vectors along the distal links, e those in which the elbows move. Returns the status; the volume -det [d_1;
    d_2; d_3], positive below the elbows; the smallest d_i·e_i, positive for arms pointing outward. SINGULAR: one of
    them is not above its minimum, the matrices are then of no use.
    """
    l1 = constants[PROXIMAL]
    determinant = dot(d[0], cross(d[1], d[2]))
    transmission, per_volume = 1.0, l1 / determinant
    for i in range(3):
        effect = dot(d[i], e[i])
        transmission = min(transmission, effect)
        column = cross(d[(i + 1) % 3], d[(i + 2) % 3])
        rate, reach = 1.0 / (l1 * effect), per_volume * effect
        for k in range(3):
            inverse[i, k] = rate * d[i][k]
            jacobian[k, i] = reach * column[k]
    regular = -determinant >= MIN_DETERMINANT and transmission >= MIN_TRANSMISSION
    return (OK if regular else SINGULAR), -determinant, transmission
