# SPDX-License-Identifier: GPL-3.0-or-later
"""Pressure, tension and wear of the contact against integrals of point forces, geometry and a run's own motion."""

from collections.abc import Iterable
from math import cos, pi, sin, sqrt

import numpy as np
import pytest
from scipy.integrate import quad

import pyspice_runner as pr
from pyspice_runner.motor import strength
from pyspice_runner.motor.contact import contact_radius
from pyspice_runner.motor.materials import Materials
from pyspice_runner.motor.parameters import Contact
from tests.motors import BEAM40

ALUMINA = Materials(
    tip_radius_m=0.005, tip_youngs_modulus_pa=370e9, tip_poisson=0.22,
    rotor_youngs_modulus_pa=370e9, rotor_poisson=0.22,
)  # fmt: skip
NEW = Contact(**ALUMINA.constants(0.015), friction=0.3, preload_n=6.5, specific_wear_rate_m3_per_n_m=1e-15)
FLAGSHIP = pr.load_motor(BEAM40)
OF_CONTACT = ("The peak pressure", "Friction puts", "The results are those of a")


def told(motor: pr.Motor, **found: float) -> list[str]:
    """Return the sentences about the contact, with plain spaces."""
    return spoken(strength.exceeded(motor, found))


def spoken(cautions: Iterable[str]) -> list[str]:
    """Return the sentences about the contact among the cautions of a result, with plain spaces."""
    return [text.replace("\N{NO-BREAK SPACE}", " ") for text in cautions if text.startswith(OF_CONTACT)]


def chord(x: float, y: float, angle: float) -> float:
    """Integral of √(1 − r²) along the ray from a point in the unit circle to its edge."""
    b, c = x * cos(angle) + y * sin(angle), x * x + y * y - 1.0
    value, _ = quad(lambda s: sqrt(max(-(s * s + 2.0 * b * s + c), 0.0)), 0.0, sqrt(max(b * b - c, 0.0)) - b, limit=200)
    return float(value)


def displaced(x: float, y: float, poisson: float, friction: float) -> tuple[float, float]:
    """Surface displacements times 2πG/p₀ by the point forces of Boussinesq and Cerruti (Johnson §3.2 and §3.6)."""

    def integral(part: int) -> float:
        def of_ray(angle: float) -> float:
            # the force lies at the end of the ray; the point is seen from it in the opposite direction
            along, seen = -cos(angle), (-cos(angle), -sin(angle))[part]
            moved = -0.5 * (1.0 - 2.0 * poisson) * seen + friction * poisson * along * seen
            return chord(x, y, angle) * (moved + (friction * (1.0 - poisson) if part == 0 else 0.0))

        return float(quad(of_ray, 0.0, 2.0 * pi, limit=100, epsabs=1e-9)[0])

    return integral(0), integral(1)


@pytest.mark.parametrize(("poisson", "friction"), [(0.3, 0.0), (0.22, 0.3)])
def test_the_tension_behind_a_sliding_contact_is_that_of_its_point_forces(poisson: float, friction: float) -> None:
    """The stress just inside the edge is the closed form's, whose limit at the edge is the tension.

    Friction acts on this body along +x, so that the trailing edge is at x = −1.
    """
    edge, h = -0.97, 0.005
    before, after = (displaced(edge + step, 0.0, poisson, friction)[0] for step in (-h, h))
    strain_x = (after - before) / (2.0 * h)
    strain_y = displaced(edge, h, poisson, friction)[1] / h
    shear = 1.0 / (2.0 * pi)  # G over p₀ in these units
    w = sqrt(1.0 - edge**2)  # the pressure over p₀
    stress = 2.0 * shear / (1.0 - poisson) * (strain_x + poisson * strain_y) - poisson / (1.0 - poisson) * w
    of_friction = pi * (4.0 + poisson) / 8.0 * friction * -edge
    of_pressure = (1.0 - 2.0 * poisson) / 3.0 / edge**2 * (1.0 - w**3) - w  # Johnson eq. 3.42
    assert stress == pytest.approx(of_friction + of_pressure, abs=2e-3)  # differences over h
    contact = NEW.model_copy(update={"poisson": poisson, "friction": friction})
    at_edge = strength.tensile_stress(contact, 10.0) / strength.peak_pressure(contact, 10.0)
    assert at_edge == pytest.approx((of_friction / -edge) + (1.0 - 2.0 * poisson) / 3.0, rel=1e-12)


def test_the_peak_pressure_is_one_and_a_half_times_the_mean() -> None:
    """A steel ball of 10 mm radius on a plate, 100 N: a = 0.1866 mm (Johnson §4.2)."""
    steel = Materials(
        tip_radius_m=0.010, tip_youngs_modulus_pa=210e9, tip_poisson=0.3,
        rotor_youngs_modulus_pa=210e9, rotor_poisson=0.3,
    )  # fmt: skip
    contact = Contact(**steel.constants(1e9), friction=0.2, preload_n=100.0)
    assert contact_radius(contact, 100.0) == pytest.approx(0.1866e-3, rel=1e-3)
    assert strength.peak_pressure(contact, 100.0) == pytest.approx(1.5 * 100.0 / (pi * 0.1866e-3**2), rel=2e-3)
    assert strength.peak_pressure(contact, 0.0) == 0.0


def test_a_flat_takes_the_volume_between_two_paraboloids() -> None:
    radius = contact_radius(NEW, 6.5)
    volume, _ = quad(lambda r: (radius**2 - r**2) / (2.0 * 0.00375) * 2.0 * pi * r, 0.0, radius)
    assert strength.time_to_flat(NEW, 1e-15) == pytest.approx(volume / 1e-15, rel=1e-9)


def test_what_is_not_known_is_not_stated() -> None:
    bare = NEW.model_copy(update={"effective_radius_m": None, "poisson": None, "specific_wear_rate_m3_per_n_m": None})
    assert all(np.isnan(value) for value in strength.of_contact(bare, 10.0, 1.0).values())
    assert np.isnan(strength.time_to_flat(bare, 1e-15))
    assert all(np.isfinite(value) for value in strength.of_contact(NEW, 10.0, 1.0).values())


def test_a_steady_state_wears_by_the_slip_of_its_own_motion() -> None:
    """Slip is the path of the tip less those of the rotor and of the spring; the normal force weighs it."""
    state = pr.steady_state(FLAGSHIP, pr.default_drive(FLAGSHIP), speed=20.0)
    waves = state.waveforms
    path = waves.tip_x_m - waves.time_s * 20.0 * FLAGSHIP.rotor.radius_m - waves.contact_displacement_m
    normal = 0.5 * (waves.normal_force_n[1:] + waves.normal_force_n[:-1])
    closed = normal > 0.05 * normal.max()
    rubbed = float((normal * np.abs(np.diff(path)))[closed].sum()) / (waves.time_s[-1] - waves.time_s[0])
    # the slope of the rotor's surface, some 1e-3 of the motion, and half a step at each change of state
    expected = FLAGSHIP.contact.specific_wear_rate_m3_per_n_m * rubbed
    assert state.wear_volume_m3_per_s == pytest.approx(expected, rel=0.02)
    greatest = waves.normal_force_n.max()
    assert state.peak_pressure_pa == pytest.approx(strength.peak_pressure(FLAGSHIP.contact, greatest), rel=1e-3)
    assert state.tensile_stress_pa == pytest.approx(strength.tensile_stress(FLAGSHIP.contact, greatest), rel=1e-3)
    tension, flat = spoken(state.cautions)
    assert tension.startswith("Friction puts the trailing edge of the contact under a tension of 1.415 GPa;")
    assert flat.startswith("The results are those of a new tip: after 13.9")


def test_a_brush_wears_by_its_loss_and_a_free_tip_does_not() -> None:
    drive = pr.default_drive(FLAGSHIP)
    free, brush = (pr.steady_state(FLAGSHIP, drive, contact=law, speed=20.0) for law in (None, "brush"))
    assert np.isnan(free.wear_volume_m3_per_s)
    # the loss is extrapolated to a vanishing step as well
    expected = FLAGSHIP.contact.specific_wear_rate_m3_per_n_m * brush.friction_loss_w / 0.3
    assert brush.wear_volume_m3_per_s == pytest.approx(expected, rel=1e-9)


def test_each_limit_of_the_contact_has_its_sentence() -> None:
    found = {"peak_pressure_pa": 2e9, "tensile_stress_pa": 1e9}
    (tension,) = told(FLAGSHIP, **found)
    assert "its strength is 380 MPa" in tension
    weak = FLAGSHIP.updated({"limits.contact_pressure_pa": 1e9})
    assert told(weak, **found)[0].startswith("The peak pressure of the contact is 2 GPa; the limit is 1 GPa")
    assert told(FLAGSHIP.updated({"limits.contact_tension_pa": None}), **found) == []
    volume = 1e-16 * strength.time_to_flat(FLAGSHIP.contact, 1e-16)  # of a flat of 45 µm
    assert told(FLAGSHIP, wear_volume_m3_per_s=volume / 3601.0) == []
    (flat,) = told(FLAGSHIP, wear_volume_m3_per_s=volume / 3599.0)
    assert "after 3.599 ks" in flat
    assert "45.47 µm in radius" in flat
    worn = FLAGSHIP.updated({"contact.worn_flat_radius_m": 1e-4})
    volume = 1e-16 * strength.time_to_flat(worn.contact, 1e-16)
    assert volume == pytest.approx(3.0 * pi * 1e-4**4 / (4.0 * 0.00375))
    (wider,) = told(worn, wear_volume_m3_per_s=volume / 60.0)
    assert wider.endswith("a flat of 100 µm in radius: after 60 s its radius is 141.4 µm.")
