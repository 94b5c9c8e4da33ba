# SPDX-License-Identifier: GPL-3.0-or-later
"""``piezomotor impact``: the impact of a sphere on a half-space, a test of the contact laws."""

from __future__ import annotations

from typing import Annotated

import typer

from pyspice_runner.commands import common
from pyspice_runner.commands.options import LawOptions, Targets, with_options


@with_options
def impact(
    *,
    law: LawOptions,
    poisson: Annotated[float, typer.Option(help="Poisson's ratio of sphere and half-space.")] = 0.3,
    psi: Annotated[float, typer.Option(help="Incidence: 2(1-v)/(2-v) v_t/(mu v_n) of the contact patch.")] = 1.0,
    friction: Annotated[float, typer.Option(help="Coefficient of friction.")] = 0.2,
    restitution: Annotated[float, typer.Option(help="Coefficient of restitution along the normal.")] = 1.0,
    velocity: Annotated[float, typer.Option(help="Approach velocity, m/s.")] = 1.0,
    spin: Annotated[float, typer.Option(help="Spin before the impact, rad/s.")] = 0.0,
    radius: Annotated[float, typer.Option(help="Radius of the sphere, m.")] = 5e-3,
    density: Annotated[float, typer.Option(help="Density of the sphere, kg/m3.")] = 7850.0,
    youngs_modulus: Annotated[float, typer.Option(help="Young's modulus of sphere and half-space, Pa.")] = 206e9,
    timeout: common.TimeoutOption = None,
    audit: common.AuditOption = True,
    targets: Targets,
) -> None:
    """Simulate the impact of an elastic sphere on a half-space. Writes .csv (over time), .json or .cir (the deck).

    Example: piezomotor impact --contact brush --poisson 0.3 --psi 1.2 --plot impact.png
    """
    contact = law.law
    targets.check(".csv", ".json", ".cir")
    from pyspice_runner.run.impact import Throw
    from pyspice_runner.run.impact import impact as rebound

    throw = Throw(
        psi=psi, velocity_m_s=velocity, spin_rad_s=spin, friction=friction, restitution=restitution,
        radius_m=radius, density_kg_m3=density, youngs_modulus_pa=youngs_modulus, poisson=poisson,
    )  # fmt: skip
    with common.busy("simulating the impact"):
        result = rebound(throw, contact, timeout=timeout, audit=audit)
    common.warn_of(result.audit.findings)
    targets.deliver(result, f"{law.contact}, Poisson's ratio {poisson:g}")
