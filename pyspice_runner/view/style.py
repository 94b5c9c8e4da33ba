# SPDX-License-Identifier: GPL-3.0-or-later
"""The look that plots, figures and report pages share: colours, contact states, and the labels of quantities."""

from __future__ import annotations

from typing import NamedTuple

# Okabe and Ito's palette, for readers with any colour vision. Purple and grey are darker than theirs: all but orange
# have a contrast of at least 3 : 1 against a white and a dark page.
BLACK, BLUE, VERMILION, GREEN, ORANGE = "#000000", "#0072B2", "#D55E00", "#009E73", "#E69F00"
PURPLE, GREY = "#BA6A98", "#808080"
CAUTION = VERMILION  # of the words that a result is not settled, or failed its audit

# Curves of one chart differ in colour and in dash, which also distinguishes them in print.
CYCLE = (BLUE, VERMILION, GREEN, PURPLE)
GROUPS = {"a": BLUE, "b": VERMILION}  # of the motor


class State(NamedTuple):
    """How a state of the contact is drawn."""

    name: str
    colour: str
    dash: str  # in Plotly's words


STATES = (
    State("separated", GREEN, "dot"),
    State("stick", BLUE, "solid"),
    State("slip", VERMILION, "dash"),
)  # in the order of their numbers 0, 1, 2


class Label(NamedTuple):
    """How a quantity is written at an axis: its name, the unit, and the factor from SI to that unit."""

    name: str
    unit: str
    scale: float = 1.0

    def __str__(self) -> str:
        return f"{self.name} in {self.unit}" if self.unit else self.name


LABELS = {
    "time_ms": Label("time", "ms", 1e3),
    "time_us": Label("time", "µs", 1e6),
    "frequency_hz": Label("frequency", "kHz", 1e-3),
    "magnitude_s": Label("|Y|", "mS", 1e3),
    "phase_deg": Label("phase", "degrees"),
    "conductance_s": Label("conductance G", "mS", 1e3),
    "susceptance_s": Label("susceptance B", "mS", 1e3),
    "voltage_v": Label("voltage", "V"),
    "current_a": Label("current", "mA", 1e3),
    "current_rms_a": Label("RMS current", "mA", 1e3),
    "tip_x_m": Label("tip x, along the rotor,", "µm", 1e6),
    "tip_y_m": Label("tip y, towards the rotor,", "µm", 1e6),
    "force_n": Label("force", "N"),
    "rotor_speed_rad_s": Label("rotor speed", "rad/s"),
    "speed_rad_s": Label("speed", "rad/s"),
    "torque_n_m": Label("torque on the rotor", "mN·m", 1e3),
    "shaft_power_w": Label("shaft power", "mW", 1e3),
    "electrical_power_w": Label("electrical power", "W"),
    "efficiency": Label("efficiency", "%", 100.0),
    "rotor_position_rad": Label("rotor position", "rad"),
    "temperature_c": Label("temperature", "°C"),
    "deviation": Label("deviation", "%", 100.0),
}
_OF_SLIDER = {
    "tip_x_m": Label("tip x, along the slider,", "µm", 1e6),
    "tip_y_m": Label("tip y, towards the slider,", "µm", 1e6),
    "rotor_speed_rad_s": Label("slider speed", "mm/s", 1e3),
    "rotor_position_rad": Label("slider position", "mm", 1e3),
    "speed_rad_s": Label("speed", "mm/s", 1e3),
    "torque_n_m": Label("force on the slider", "N"),
}


def time_label(longest_s: float) -> Label:
    """Return the label of a time axis that ends at a time in s: in ms, s or min."""
    if longest_s < 1.0:
        return LABELS["time_ms"]
    return Label("time", "s") if longest_s < 120.0 else Label("time", "min", 1.0 / 60.0)


def label_of(name: str, linear: bool) -> Label:
    """Return the label of a quantity; with ``linear`` that of a motor with a slider."""
    return _OF_SLIDER.get(name, LABELS[name]) if linear else LABELS[name]
