# SPDX-License-Identifier: GPL-3.0-or-later
"""Networks and cables against closed forms and a deck of plain elements."""

from math import pi
from pathlib import Path

import numpy as np
import pytest

import pyspice_runner as pr
from pyspice_runner.drivers.design import at_stage, load_of, network_of
from pyspice_runner.drivers.loads import exceeded, part_loads
from pyspice_runner.drivers.parts import largest_inductance, passed
from pyspice_runner.spice.library import definitions, read_library
from tests.circuit.batch import measured

OHMS, HENRIES, WOUND = 17.0, 6.8e-3, 20e-12  # a coil
DIGITS = 1e-6  # relative, of what ngspice prints
PARTS = {
    "inductor.inductance": HENRIES, "inductor.resistance": OHMS, "inductor.winding_capacitance": WOUND,
    "inductor.capacitance": 2e-9, "inductor.bleeder": 180e3,
    "cable.inductance": 2e-6, "cable.resistance": 1.5, "cable.capacitance": 300e-12,
}  # fmt: skip


def driver(**settings: float) -> pr.Driver:
    return pr.Driver(kind="ideal", network="inductor", voltage=100.0, frequency=40e3).updated(settings)


@pytest.mark.parametrize(("library", "prefix"), [("driver_inductor", ""), ("driver_llcc", "series_")])
def test_a_winding_resonates_at_one_over_two_pi_root_lc_with_l_over_rc(
    library: str, prefix: str, tmp_path: Path
) -> None:
    """R + jωL beside 1/(jωC) is L/(RC) − j ωL/(1 + …) at ω = 1/√(LC): the real part is L/(RC), exactly.

    A capacitor in series of 1 µF has j 0.4 Ω there; the real part of the impedance does not contain it.
    """
    resonance = 1.0 / (2.0 * pi * (HENRIES * WOUND) ** 0.5)
    end, pair = "out 0" if prefix else "out", f"{prefix}inductance={HENRIES} {prefix}resistance={OHMS}"
    found = measured(
        f"""winding
{definitions(read_library(library))}
Isource 0 in DC 0 AC 1
Xcoil in {end} {library} {pair} {prefix}capacitance=1u winding_capacitance={WOUND}
Vout out 0 0
.ac lin 3 {resonance - 0.01!r} {resonance + 0.01!r}
.measure ac real_ohm FIND v(in) AT={resonance!r}
.end
""",
        tmp_path,
    )
    assert found["real_ohm"] == pytest.approx(HENRIES / (OHMS * WOUND), rel=DIGITS)


def test_a_cable_divides_the_voltage_with_the_capacitance_of_the_group(tmp_path: Path) -> None:
    """2 nF in series with 600 pF and 300 pF of the cable: 2/2.9. At 1 kHz ω²LC of 2 µH is 4e-8."""
    found = measured(
        f"""divider
{definitions(read_library("driver_cable"))}
Vin in 0 DC 0 AC 1
Cseries in line 2n
Xcable line out 0 driver_cable inductance=1u capacitance=300p
Cgroup out 0 600p
Rline line 0 1e12
.ac lin 3 999.99 1000.01
.measure ac out_v FIND v(out) AT=1k
.end
""",
        tmp_path,
    )
    assert found["out_v"] == pytest.approx(2.0 / 2.9, rel=DIGITS)


def test_voltage_and_current_of_a_stage_are_those_of_a_deck_of_plain_elements(tmp_path: Path) -> None:
    """Series pair with winding, bleeder and cable in front of 1.2 kΩ + j 765 Ω: one volt at the stage."""
    load = 1200.0 + 765.0j
    parts: dict[str, list[float]] = {"pin_v": [], "stage_a": []}
    for turned in (0, -90):  # FIND gives the real part; turned by −90° it is the imaginary one
        folder = tmp_path / str(turned)
        folder.mkdir()
        found = measured(
            f"""plain elements
Vstage s 0 DC 0 AC 1 {turned}
Rcoil s c {OHMS}
Lcoil c m {HENRIES}
Cwound s m {WOUND}
Cpair m n 2n
Rbleed m n 180k
Rcable n q 1.5
Lcable q a 2u
Ccable a 0 300p
Rload a r {load.real}
Lload r 0 {load.imag / (2.0 * pi * 40e3)!r}
.ac lin 3 39999.99 40000.01
.measure ac pin_v FIND v(a) AT=40k
.measure ac stage_a FIND i(Vstage) AT=40k
.end
""",
            folder,
        )
        for name, values in parts.items():
            values.append(found[name])
    pin, through = complex(*parts["pin_v"]), -complex(*parts["stage_a"])
    volts, amperes = at_stage(driver(**PARTS), "a", pin, pin / load)
    assert abs(volts - 1.0) < 10.0 * DIGITS  # four numbers with their digits
    assert abs(amperes / through - 1.0) < 10.0 * DIGITS
    # as a source with a series impedance and an admittance across the pin
    series, across = network_of(driver(**PARTS), "a")
    assert pin == pytest.approx(1.0 / (1.0 + series * (1.0 / load + across)), rel=10.0 * DIGITS)


def test_a_network_loses_in_its_resistances_what_the_stage_delivers_more_than_the_load_takes() -> None:
    driven, load = driver(**PARTS), 1200.0 + 765.0j
    volts, amperes = at_stage(driven, "a", 1.0, 1.0 / load)
    parts = {part.label: part.values for part in driven.parts("a")}
    cable = passed("cable", parts["cable"], 1.0, 1.0 / load, 2.0 * pi * 40e3)
    assert cable
    assert load_of(driven, "a", load) == pytest.approx(cable.volts / cable.amperes)
    pair = passed("inductor", parts["inductor"], cable.volts, cable.amperes, 2.0 * pi * 40e3)
    assert pair
    lost = OHMS * abs(pair.stores["lseries"]) ** 2 + abs(pair.stores["cseries"]) ** 2 / 180e3
    lost += 1.5 * abs(cable.stores["lline"]) ** 2
    delivered = (volts * amperes.conjugate()).real - (1.0 / load).real  # of phasors: twice the power
    assert delivered == pytest.approx(lost, rel=1e-9)  # rounding


def test_there_is_a_cable_where_one_of_its_parameters_is_stated() -> None:
    assert [part.label for part in driver().parts("a")] == ["inductor"]
    one = driver(**{"cable_b.capacitance": 200e-12})
    assert [[part.label for part in one.parts(group)] for group in "ab"] == [["inductor"], ["inductor", "cable"]]
    assert one.setting("cable_b.inductance") == 250e-9
    with pytest.raises(pr.ParameterError, match=r"cable of group A: .*capacitance = 1 F is not valid"):
        driver(**{"cable.capacitance": 1.0})


def test_the_self_resonance_of_a_coil_counts_with_the_winding_that_is_stated() -> None:
    """At 40 kHz 88 mH with the 20 pF that are assumed; 22 mH with 80 pF: three times the drive."""
    assert largest_inductance(40e3, 80e-12) == pytest.approx(0.25 * largest_inductance(40e3))
    coil = {"inductor_a.inductance": 30e-3, "inductor.capacitance": 1e-9}
    told = []
    for winding in (0.0, 80e-12):
        drive = driver(**coil, **{"inductor.winding_capacitance": winding})
        zeros = dict.fromkeys(vectors(), np.zeros(1))
        told.append(exceeded(part_loads(drive, zeros), drive))
    assert told[0] == []
    assert [sentence.split(" has ")[0] for sentence in told[1]] == ["The series coil, group A"]


def vectors() -> list[str]:
    inside = [
        f"{kind}_{group}{end}" for group in "ab" for kind, end in (("v(line", ")"), ("i(vout", ")"), ("i(vpin", ")"))
    ]
    inside += [f"v({group})" for group in "ab"]
    inside += [f"i(v.xnetwork_{group}.v{place})" for group in "ab" for place in ("current", "coil")]
    return [*inside, *(f"v(xnetwork_{group}.inner)" for group in "ab")]
