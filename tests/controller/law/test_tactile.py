"""The tactile loop: sensors and gripper by themselves, the admittance, and both closed over the arm on the DAE."""

from __future__ import annotations

import numpy as np
import pytest

from controller.law.tactile import (
    Pair,
    admittance,
    force_on_tool,
    grip_force,
    gripper_acceleration,
    least_contact_damping,
    motor_force,
    sensor_rate,
)
from controller.law.task_space import TaskSpaceController, pack_reference
from controller.model.compiled import FloatArray
from controller.model.constants import DeltaModel
from controller.model.kinematics import Status
from controller.offline.simulation import ConstrainedArm, Moment
from hardware.parameters import load_parameters

PARAMETERS = load_parameters()
GRIPPER = PARAMETERS.gripper
BANDWIDTH = PARAMETERS.tactile.bandwidth
MODEL = DeltaModel(PARAMETERS)
CENTRE = (0.0, 0.0, 0.45)


def effective_mass() -> float:
    control = TaskSpaceController(MODEL)
    state = ConstrainedArm(MODEL).at(CENTRE)
    control.update(Moment(0.0, *state, np.empty(0), MODEL).angle, (0.0, 0.0, 0.0))
    return float(1.0 / np.linalg.inv(control.state.task_inertia)[0, 0])


# -------------------------------------------------------------------------------------------------- sensor and gripper


def test_sensor_is_a_low_pass_of_100_rad_per_second() -> None:
    assert BANDWIDTH == 100.0
    output, step = 0.3, 1e-5
    for _ in range(1000):
        output += step * sensor_rate(output, 2.0, BANDWIDTH)
    assert output == pytest.approx(2.0 + (0.3 - 2.0) * np.exp(-BANDWIDTH * 1e-2), rel=1e-3)


def test_gripper_follows_its_velocity_and_presses_with_r4_k_v4() -> None:
    """In the air both fingers reach the velocity asked; on an object the motor's force is shared by both pads."""
    velocity, step = 0.0, 1e-4
    for _ in range(2000):
        velocity += step * gripper_acceleration(PARAMETERS, -0.025, velocity, (0.0, 0.0))
    assert velocity == pytest.approx(-0.025, rel=1e-6)
    force = grip_force(GRIPPER, -0.025)
    assert force == pytest.approx(0.025 * GRIPPER.velocity_gain)
    assert gripper_acceleration(PARAMETERS, -0.025, 0.0, (force, force)) == pytest.approx(0.0, abs=1e-12)


def test_gripper_is_limited_in_force_and_speed() -> None:
    assert motor_force(GRIPPER, -GRIPPER.max_speed, 0.5) == -2.0 * GRIPPER.max_force
    assert motor_force(GRIPPER, -10.0, -GRIPPER.max_speed) == 0.0
    assert grip_force(GRIPPER, -10.0) == min(GRIPPER.max_force, GRIPPER.velocity_gain * GRIPPER.max_speed)


def test_the_gripper_yields_much_less_than_the_arm() -> None:
    """The large gear ratio: at the sensor's bandwidth a finger's own admittance is far below the arm's."""
    s = 1j * BANDWIDTH
    whole = admittance(PARAMETERS, effective_mass(), 1.0, 2.0, 2.0, s)
    finger = 1.0 / (2.0 * (PARAMETERS.inertia.finger_mass + GRIPPER.reflected_mass) * s + 2.0 * GRIPPER.velocity_gain)
    assert abs(finger) < 0.2 * abs(whole)


# ------------------------------------------------------------------------------------------------------------ the loop


def test_feedback_is_that_of_the_law() -> None:
    control = TaskSpaceController(MODEL)
    control.update(Moment(0.0, *ConstrainedArm(MODEL).at(CENTRE), np.empty(0), MODEL).angle, (0.0, 0.0, 0.0))
    for sensed in ((0.5, 0.1), (0.0, 0.7)):
        control.torque(pack_reference(CENTRE, tactile_gain=2.0), sensed)
        assert control.state.asked[0] == pytest.approx(2.0 * (sensed[0] - sensed[1]))
        assert not control.state.asked[1:].any()


def test_admittance_rises_by_about_10_db_within_the_sensors_band() -> None:
    """Fig. 5: k_p = 1, k_v = 2, k_s = 100; and not above the band, where the sensor no longer follows."""
    mass = effective_mass()
    rise = {
        omega: 20.0
        * np.log10(
            abs(admittance(PARAMETERS, mass, 1.0, 2.0, 2.0, 1j * omega))
            / abs(admittance(PARAMETERS, mass, 1.0, 2.0, 0.0, 1j * omega))
        )
        for omega in (1.0, 3.0, 10.0, 100.0, 1000.0)
    }
    print("k* = 2 raises the admittance [dB]:", {omega: round(value, 2) for omega, value in rise.items()})
    assert all(rise[omega] == pytest.approx(10.0, abs=0.5) for omega in (1.0, 3.0, 10.0))
    assert rise[100.0] < 8.0
    assert abs(rise[1000.0]) < 1.0


class Pads:
    """Sensors and gripper; a force of our choice on the right pad."""

    def __init__(self, amplitude: float, omega: float) -> None:
        self.amplitude, self.omega = amplitude, omega

    def pressing(self, moment: Moment) -> Pair:
        return self.amplitude * float(np.sin(self.omega * moment.time)), 0.0

    def start(self) -> FloatArray:
        return np.zeros(2)  # ż4 and the right sensor

    def rates(self, moment: Moment) -> FloatArray:
        forces = self.pressing(moment)
        return np.array(
            [
                gripper_acceleration(PARAMETERS, 0.0, float(moment.own[0]), forces),
                sensor_rate(float(moment.own[1]), forces[0], BANDWIDTH),
            ]
        )

    def force(self, moment: Moment) -> tuple[float, float, float]:
        return force_on_tool(self.pressing(moment)), 0.0, 0.0


@pytest.mark.parametrize("gain", [0.0, 2.0])
def test_admittance_formula_is_that_of_the_nonlinear_arm(gain: float) -> None:
    """A small sine on the right pad of the DAE under (23): amplitude and phase of the finger's velocity."""
    omega, amplitude = 30.0, 0.05
    still = PARAMETERS.friction.model_copy(update={"viscous": 0.0, "coulomb": 0.0})
    model = DeltaModel(PARAMETERS.model_copy(update={"friction": still}))
    arm, control = ConstrainedArm(model), TaskSpaceController(model)
    reference = pack_reference(
        CENTRE, stiffness=(1.0, 4900.0, 4900.0), damping=(2.0, 140.0, 140.0), tactile_gain=gain
    )  # fmt: skip

    def law(moment: Moment) -> tuple[float, float, float]:
        assert control.update(moment.angle, moment.rate) is Status.OK
        return control.torque(reference, (float(moment.own[1]), 0.0))

    periods = 4
    times = np.linspace(0.0, periods * 2.0 * np.pi / omega, periods * 64 + 1)
    path = arm.simulate(
        arm.at(CENTRE), law, float(times[-1]), attachment=Pads(amplitude, omega), rtol=1e-7, atol=1e-9, times=times
    )
    velocity = path.velocity[:, 0] + path.own[:, 0]
    late = path.time >= 0.5 * path.time[-1]
    t = path.time[late]
    # what the start leaves decays slowly, as exp(-t) and t exp(-t): fitted beside the sine
    basis = np.stack([np.sin(omega * t), np.cos(omega * t), np.exp(-t), t * np.exp(-t)], axis=1)
    sine, cosine = np.linalg.lstsq(basis, velocity[late])[0][:2]
    found = complex(sine, cosine) / amplitude
    expected = admittance(PARAMETERS, effective_mass(), 1.0, 2.0, gain, 1j * omega)
    print(f"k* = {gain}: |A| {20 * np.log10(abs(found)):.3f} dB, formula {20 * np.log10(abs(expected)):.3f} dB")
    assert found == pytest.approx(expected, rel=5e-3)


# -------------------------------------------------------------------------------------------------------- hard contact


def poles(mass: float, damping: float, gain: float, stiffness: float, contact_damping: float) -> FloatArray:
    """Of arm, sensor and a fixed object at one pad, as a matrix: z, ż, s."""
    matrix = np.array(
        [
            [0.0, 1.0, 0.0],
            [-stiffness / mass, -damping - contact_damping / mass, gain],
            [-BANDWIDTH * stiffness, -BANDWIDTH * contact_damping, -BANDWIDTH],
        ]
    )
    return np.linalg.eigvals(matrix).real


@pytest.mark.parametrize(("gain", "damping"), [(2.0, 0.1), (2.0, 20.0), (0.5, 0.1)])
def test_contact_needs_the_damping_that_routh_says(gain: float, damping: float) -> None:
    mass = effective_mass()
    for stiffness in (1e3, 1e4, 1e5):
        least = least_contact_damping(PARAMETERS, mass, damping, gain, stiffness)
        print(f"k* = {gain}, k_v = {damping}, object of {stiffness:.0e} N/m: needs {least:.1f} N s/m of damping")
        assert poles(mass, damping, gain, stiffness, 1.01 * least + 1e-6).max() < 0.0
        if least > 0.0:
            assert poles(mass, damping, gain, stiffness, 0.99 * least).max() > 0.0


def test_contact_without_feedback_needs_no_damping() -> None:
    assert least_contact_damping(PARAMETERS, effective_mass(), 0.1, 0.0, 1e4) == 0.0
