"""Vectors of three as tuples, which Numba keeps in registers: nothing is allocated."""

from controller.model.compiled import FloatArray, Vector, compiled
from controller.model.constants import ARM_COS, ARM_SIN


@compiled
def dot(a: Vector, b: Vector) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """Vector product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def minus(a: Vector, b: Vector) -> Vector:
    """Difference of two vectors."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@compiled
def scaled(s: float, a: Vector) -> Vector:
    """Vector s a."""
    return s * a[0], s * a[1], s * a[2]


@compiled
def combine(o: Vector, s: float, a: Vector) -> Vector:
    """Vector o + s a."""
    return o[0] + s * a[0], o[1] + s * a[1], o[2] + s * a[2]


@compiled
def turn(arm: int, v: Vector) -> Vector:
    """R_i v: from the frame of an arm (0, 1, 2) into the base frame."""
    c, s = ARM_COS[arm], ARM_SIN[arm]
    return c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]


@compiled
def turn_back(arm: int, v: Vector) -> Vector:
    """R_iᵀ v: from the base frame into the frame of an arm."""
    c, s = ARM_COS[arm], ARM_SIN[arm]
    return c * v[0] + s * v[1], -s * v[0] + c * v[1], v[2]


@compiled
def times(matrix: FloatArray, v: Vector) -> Vector:
    """A 3x3 array times a vector."""
    return (
        matrix[0, 0] * v[0] + matrix[0, 1] * v[1] + matrix[0, 2] * v[2],
        matrix[1, 0] * v[0] + matrix[1, 1] * v[1] + matrix[1, 2] * v[2],
        matrix[2, 0] * v[0] + matrix[2, 1] * v[1] + matrix[2, 2] * v[2],
    )


@compiled
def distance(a: Vector, b: Vector) -> float:
    """Largest difference of two points along an axis."""
    return max(abs(a[0] - b[0]), abs(a[1] - b[1]), abs(a[2] - b[2]))


@compiled
def common_point(d1: Vector, d2: Vector, d3: Vector, b: Vector) -> tuple[float, Vector]:
    """Solve d_i·z = b_i by Cramer's rule: det [d1; d2; d3] and z, which is not finite where the determinant is zero."""
    d23, d31, d12 = cross(d2, d3), cross(d3, d1), cross(d1, d2)
    determinant = dot(d1, d23)
    z = combine(combine(scaled(b[0], d23), b[1], d31), b[2], d12)
    return determinant, scaled(1.0 / determinant, z)
