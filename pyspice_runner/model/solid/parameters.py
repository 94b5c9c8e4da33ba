# SPDX-License-Identifier: GPL-3.0-or-later
"""The table ``[solid]`` of a motor: boxes of material, electrodes, supports and the face that touches the rotor."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from pyspice_runner.errors import ParameterError
from pyspice_runner.model.parameters import Parameters, quantity
from pyspice_runner.model.refusal import as_table, build, quoted
from pyspice_runner.model.solid.materials import materials

Point = tuple[float, float, float]
Sense = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
LARGEST = 1.0  # m, of a coordinate


class Placed(Parameters):
    """What fills the space between two opposite corners; a face has one coordinate, a point all three in common."""

    from_m: Point = Field(description="corner with the least coordinates", json_schema_extra={"unit": "m"})
    to_m: Point = Field(description="corner with the greatest coordinates", json_schema_extra={"unit": "m"})

    @field_validator("from_m", "to_m", mode="before")
    @classmethod
    def _corner(cls, value: Any, info: ValidationInfo) -> Point:
        numbers = isinstance(value, list | tuple) and all(type(item) in (int, float) for item in value)
        if not (numbers and len(value) == 3 and all(abs(item) <= LARGEST for item in value)):
            raise ValueError(
                f"{info.field_name} = {quoted(value)} is not valid: it must be three coordinates in m, from -1 to 1"
            )
        x, y, z = map(float, value)
        return x, y, z

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        for axis, low, high in zip("xyz", self.from_m, self.to_m, strict=True):
            if low > high:
                raise ValueError(f"from_m has {axis} = {low:g} m above {high:g} m of to_m; exchange the two")
        return self


class Box(Placed):
    """A block of one material. Where two boxes overlap, the later one counts."""

    material: str = Field(
        description="name of a material of the library",
        max_length=20,
        json_schema_extra={"made_of": "letters, digits and -"},
    )
    polarisation: Sense = Field(description="sense in which a ceramic is poled", default="+z")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.material not in materials():
            raise ValueError(f"material = {quoted(self.material)} is not known; there are {', '.join(materials())}")
        for axis, low, high in zip("xyz", self.from_m, self.to_m, strict=True):
            if low == high:
                raise ValueError(f"from_m and to_m have the same {axis} = {low:g} m; a box has a volume")
        return self


class Electrode(Placed):
    """An electrode on a face: all it covers has one potential."""

    group: Literal["A", "B", "ground"] = Field(description="electrical group, or ground")


class Support(Placed):
    """A support: it clamps what it covers, or holds it by springs that are spread over the face."""

    directions: str = Field(
        description="directions that it holds, such as xyz", default="xyz", pattern="^[xyz]{1,3}$", max_length=3,
        json_schema_extra={"made_of": "letters x, y and z"},
    )  # fmt: skip
    stiffness_n_per_m: float | None = quantity(
        "stiffness of the springs in each direction; left out: clamped", "N/m", gt=0.0, le=1e12, default=None
    )


class Face(Placed):
    """The face of the tip that touches the rotor; the contact moves by the mean of its motion."""

    normal: Sense = Field(description="sense towards the rotor")
    tangent: Sense = Field(description="sense in which the rotor's surface runs")

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.normal[1] == self.tangent[1]:
            raise ValueError(f"tangent = {self.tangent!r} is not valid: it must be at right angles to the normal")
        return self


class Solid(Parameters):
    """A stator by finite elements, in three dimensions or as a thin plate in its plane."""

    theory: Literal["solid", "plate"] = Field(
        description="solid: three dimensions; plate: thin, in the plane x, y, poled along z", default="solid"
    )
    element_m: float = quantity("greatest edge of an element", "m", ge=1e-6, le=0.1)
    lowest_hz: float = quantity("lowest frequency of the modes that the motor has", "Hz", ge=10.0, le=1e7)
    highest_hz: float = quantity("highest frequency of the modes that the motor has", "Hz", ge=10.0, le=1e7)
    quality_factor: float = quantity("quality factor of all modes", "1", gt=0.5, le=1e6)
    contact: Face
    boxes: Annotated[tuple[Box, ...], Field(min_length=1, max_length=100)]
    electrodes: Annotated[tuple[Electrode, ...], Field(min_length=2, max_length=100)]
    supports: Annotated[tuple[Support, ...], Field(max_length=100)] = ()

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.lowest_hz >= self.highest_hz:
            raise ValueError(f"lowest_hz = {self.lowest_hz:g} Hz must lie below highest_hz = {self.highest_hz:g} Hz")
        for group in ("A", "B", "ground"):
            if not any(electrode.group == group for electrode in self.electrodes):
                raise ValueError(f'electrodes: there is none with group = "{group}"; a motor has A, B and ground')
        if self.theory == "plate":
            self._check_plate()
        return self

    def _check_plate(self) -> None:
        middles = {round(box.from_m[2] + box.to_m[2], 9) for box in self.boxes}
        if len(middles) > 1:
            raise ValueError("boxes: those of a plate have a common middle plane; correct their z, or use theory solid")
        if {self.contact.normal[1], self.contact.tangent[1]} != {"x", "y"}:
            raise ValueError("contact: normal and tangent of a plate lie in its plane, along x and y")
        for index, box in enumerate(self.boxes):
            if materials()[box.material].stress_constants_c_m2.any() and box.polarisation[1] != "z":
                raise ValueError(f"boxes.{index}: a plate is poled along z; correct it, or use theory solid")


def solid_from(entry: Any, where: str) -> Solid:
    """Return the checked table ``[solid]``. Raise ParameterError for what is missing, unknown or not valid."""
    table = dict(as_table(entry, "solid", where))
    for name, kind in (("boxes", Box), ("electrodes", Electrode), ("supports", Support)):
        given = table.get(name, [])
        if not isinstance(given, list):
            raise ParameterError(f"{where}: solid.{name} must be one or more tables [[solid.{name}]].")
        table[name] = tuple(build(kind, item, f"solid.{name}.{index}", where) for index, item in enumerate(given))
    if "contact" in table:
        table["contact"] = build(Face, table["contact"], "solid.contact", where)
    return build(Solid, table, "solid", where)
