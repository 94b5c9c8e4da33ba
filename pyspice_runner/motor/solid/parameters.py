# SPDX-License-Identifier: GPL-3.0-or-later
"""The table ``[solid]`` of a motor: boxes of material, electrodes, supports and the face that touches the rotor.

A mesh file takes the place of the coordinates: its physical groups are the regions of boxes, electrodes and so on.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from pyspice_runner.errors import ParameterError, located, require
from pyspice_runner.motor.document import read_bytes
from pyspice_runner.motor.parameters import Parameters, quantity
from pyspice_runner.motor.refusal import as_table, build, check_keys, quoted
from pyspice_runner.motor.solid.materials import Material, material_of, materials

Point = tuple[float, float, float]
Sense = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
LARGEST = 1.0  # m, of a coordinate
MOST_BYTES = 2**27  # of a mesh file
COMPLIANCE, CHARGE = "1e-12 m²/N", "1e-12 C/N"  # units of a card


class MeshFile(Parameters):
    """A mesh file by its content; its place is no part of the JSON, so that the same mesh elsewhere is the same."""

    path: str = Field(exclude=True)
    sha256: str

    def __str__(self) -> str:
        return self.path


def mesh_file(path: Path) -> MeshFile:
    """Return the file of a mesh. Raise ParameterError if it cannot be read."""
    content = read_bytes(str(path), "mesh", MOST_BYTES, "the path of a .msh file, from the folder of the motor's TOML")
    return MeshFile(path=str(path), sha256=hashlib.sha256(content).hexdigest())


class Compliance(Parameters):
    """Compliance of a ceramic at constant field, poled along axis 3."""

    s11: float = quantity("s₁₁ᴱ", COMPLIANCE, gt=0.0, le=1e4)
    s12: float = quantity("s₁₂ᴱ", COMPLIANCE, ge=-1e4, le=1e4)
    s13: float = quantity("s₁₃ᴱ", COMPLIANCE, ge=-1e4, le=1e4)
    s33: float = quantity("s₃₃ᴱ", COMPLIANCE, gt=0.0, le=1e4)
    s44: float = quantity("s₄₄ᴱ", COMPLIANCE, gt=0.0, le=1e4)


class Charge(Parameters):
    """Charge constants of a ceramic."""

    d31: float = quantity("d₃₁", CHARGE, ge=-5e3, le=5e3)
    d33: float = quantity("d₃₃", CHARGE, ge=-5e3, le=5e3)
    d15: float = quantity("d₁₅", CHARGE, ge=-5e3, le=5e3)


class Permittivity(Parameters):
    """Relative permittivity of a ceramic at constant stress."""

    k11: float = quantity("ε₁₁ᵀ/ε₀", "1", ge=1.0, le=1e5)
    k33: float = quantity("ε₃₃ᵀ/ε₀", "1", ge=1.0, le=1e5)


class Card(Parameters):
    """A material of the user's own: a metal or glass by its modulus, a ceramic by the other three tables."""

    name: str = Field(description="name", min_length=1, max_length=20)
    density_kg_m3: float = quantity("density", "kg/m³", ge=100.0, le=3e4)
    specific_heat_j_per_kg_k: float = quantity("specific heat", "J/(kg·K)", gt=0.0, le=1e4)
    youngs_modulus_pa: float | None = quantity("Young's modulus", "Pa", ge=1e8, le=2e12, default=None)
    poisson: float | None = quantity("Poisson's ratio", "1", ge=0.0, le=0.49, default=None)
    compliance: Compliance | None = None
    charge: Charge | None = None
    permittivity: Permittivity | None = None
    source: str = Field(default="", description="where the values are from", max_length=500)

    @model_validator(mode="after")
    def _check(self) -> Self:
        metal = [value is not None for value in (self.youngs_modulus_pa, self.poisson)]
        ceramic = [value is not None for value in (self.compliance, self.charge, self.permittivity)]
        if not ((all(metal) and not any(ceramic)) or (all(ceramic) and not any(metal))):
            raise ValueError(
                "youngs_modulus_pa and poisson of a metal, or compliance, charge and permittivity of a ceramic, are "
                "needed; specify those of one of them"
            )
        if ceramic[0] and not self._is_stable():
            raise ValueError("compliance with charge and permittivity gives no stable material; correct them")
        return self

    def _is_stable(self) -> bool:
        try:
            made = self.material()
        except np.linalg.LinAlgError:
            return False
        return bool(min(np.linalg.eigvalsh(each)[0] for each in (made.stiffness_pa, made.permittivity_f_m)) > 0.0)

    def material(self) -> Material:
        """Return the material in the e-form."""
        return material_of(self.name, self.model_dump(exclude_none=True))


class Placed(Parameters):
    """What fills the space between two opposite corners; a face has one coordinate, a point all three in common."""

    from_m: Point | None = Field(
        default=None, description="corner with the smallest coordinates", json_schema_extra={"unit": "m"}
    )
    to_m: Point | None = Field(
        default=None, description="corner with the largest coordinates", json_schema_extra={"unit": "m"}
    )
    region: str | None = Field(
        default=None, description="instead, with a mesh: name of a physical group", min_length=1, max_length=100,
        json_schema_extra={"made_of": "characters"},
    )  # fmt: skip

    @property
    def corners(self) -> tuple[Point, Point]:
        """The two corners of what has no region."""
        assert self.from_m is not None
        assert self.to_m is not None
        return self.from_m, self.to_m

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
        given = [name for name in ("from_m", "to_m") if getattr(self, name) is not None]
        if self.region is not None:
            if given:
                raise ValueError(f"region = {quoted(self.region)} takes the place of {given[0]}; specify one of them")
            return self
        if len(given) < 2:
            missing = "to_m" if given == ["from_m"] else "from_m"
            raise ValueError(f"{missing} is missing (a corner, in m); specify it, or with a mesh the region")
        for axis, low, high in zip("xyz", *self.corners, strict=True):
            if low > high:
                raise ValueError(f"from_m has {axis} = {low:g} m above {high:g} m of to_m; exchange the two")
        return self


class Box(Placed):
    """A block of one material. Where two boxes overlap, the later one counts."""

    material: str = Field(
        description="name of a material of the library, or of solid.materials",
        max_length=20,
        json_schema_extra={"made_of": "letters, digits and -"},
    )
    polarisation: Sense = Field(description="sense in which a ceramic is poled", default="+z")
    thickness_m: float | None = quantity(
        "with the mesh of a plate: thickness of the region", "m", gt=0.0, le=LARGEST, default=None
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        for axis, low, high in zip("xyz", *self.corners, strict=True) if self.region is None else ():
            if low == high:
                raise ValueError(f"from_m and to_m have the same {axis} = {low:g} m; a box has a volume")
        if self.region is None and self.thickness_m is not None:
            raise ValueError("thickness_m belongs to a region; leave it out, as from_m and to_m specify it")
        return self

    @property
    def height_m(self) -> float:
        """Of a plate, along z."""
        return self.corners[1][2] - self.corners[0][2] if self.thickness_m is None else self.thickness_m


class Electrode(Placed):
    """An electrode on a face: all it covers has one potential."""

    group: Literal["A", "B", "feedback", "ground"] = Field(description="electrical group, or ground")
    side: Literal["+z", "-z"] | None = Field(description="with the mesh of a plate: the face it is on", default=None)


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
    mesh: MeshFile | None = Field(
        description="mesh file by gmsh, .msh, from the folder of this TOML; its groups are the regions", default=None
    )
    mesh_unit_m: float = quantity("unit of the mesh file", "m", ge=1e-9, le=1e3, default=1.0)
    element_m: float | None = quantity(
        "maximum edge of an element; left out with a mesh", "m", ge=1e-6, le=0.1, default=None
    )
    lowest_hz: float = quantity("lowest frequency of its modes", "Hz", ge=10.0, le=1e7)
    highest_hz: float = quantity("highest frequency of its modes", "Hz", ge=10.0, le=1e7)
    quality_factor: float = quantity("quality factor of all modes", "1", gt=0.5, le=1e6)
    contact: Face
    boxes: Annotated[tuple[Box, ...], Field(min_length=1, max_length=100)]
    electrodes: Annotated[tuple[Electrode, ...], Field(min_length=2, max_length=100)]
    supports: Annotated[tuple[Support, ...], Field(max_length=100)] = ()
    materials: Annotated[tuple[Card, ...], Field(max_length=100)] = ()
    faces: tuple[Face | None, ...] = ()  # of [[contacts]]: those of entries with a place of their own

    @model_validator(mode="after")
    def _check(self) -> Self:
        self._check_materials()
        for name, face in self.touched.items():
            if (face.normal, face.tangent) != (self.contact.normal, self.contact.tangent):
                raise ValueError(f"{name}: normal and tangent must be those of solid.contact; direction = -1 turns it")
        if self.lowest_hz >= self.highest_hz:
            raise ValueError(f"lowest_hz = {self.lowest_hz:g} Hz must lie below highest_hz = {self.highest_hz:g} Hz")
        for group in ("A", "B", "ground"):
            if not any(electrode.group == group for electrode in self.electrodes):
                raise ValueError(f'electrodes: there is none with group = "{group}"; a motor has A, B and ground')
        self._check_mesh()
        if self.theory == "plate":
            self._check_plate()
        return self

    def material(self, box: Box) -> Material:
        """Return the material of a box."""
        own = next((card for card in self.materials if card.name == box.material), None)
        return materials()[box.material] if own is None else own.material()

    @property
    def groups(self) -> tuple[str, ...]:
        """Names of the electrodes whose voltages count, and ground."""
        sensed = ("feedback",) if any(electrode.group == "feedback" for electrode in self.electrodes) else ()
        return ("A", "B", *sensed, "ground")

    @property
    def touched(self) -> dict[str, Face]:
        """The faces that touch the rotor by their paths: its own first, then those of ``[[contacts]]``."""
        others = {f"contacts.{index}.face": face for index, face in enumerate(self.faces) if face is not None}
        return {"contact": self.contact, **others}

    @property
    def placed(self) -> dict[str, Placed]:
        """All that has a place, by its path in the table."""
        tables = {"boxes": self.boxes, "electrodes": self.electrodes, "supports": self.supports}
        many = {f"{name}.{index}": item for name, items in tables.items() for index, item in enumerate(items)}
        return {**many, **self.touched}

    def _check_materials(self) -> None:
        own = [card.name for card in self.materials]
        for name in own:
            if name in materials():
                raise ValueError(f"materials.{name} is a material of the library; choose another name")
        known = ", ".join([*own, *materials()])
        for index, box in enumerate(self.boxes):
            if box.material not in (*own, *materials()):
                raise ValueError(f"boxes.{index}.material = {quoted(box.material)} is not known; there are {known}")

    def _check_mesh(self) -> None:
        if (self.mesh is None) == (self.element_m is None):
            raise ValueError("element_m (maximum edge of an element, in m) or a mesh is needed; specify one of them")
        for name, item in self.placed.items():
            if (self.mesh is None) != (item.region is None):
                raise ValueError(f"{name}: a region goes with a mesh, from_m and to_m without one; specify the other")
        if self.mesh is not None and self.theory == "plate":
            for name, item in self.placed.items():
                if isinstance(item, Box) and item.thickness_m is None:
                    raise ValueError(f"{name}.thickness_m is missing (thickness of the plate, in m); specify it")
                if isinstance(item, Electrode) and item.side is None:
                    raise ValueError(f'{name}.side is missing: the face of the plate, "+z" or "-z"; specify it')

    def _check_plate(self) -> None:
        middles = {round(sum(corner[2] for corner in box.corners), 9) for box in self.boxes if box.region is None}
        if len(middles) > 1:
            raise ValueError("boxes: those of a plate have a common middle plane; correct their z, or use theory solid")
        if {self.contact.normal[1], self.contact.tangent[1]} != {"x", "y"}:
            raise ValueError("contact: normal and tangent of a plate lie in its plane, along x and y")
        for index, box in enumerate(self.boxes):
            if self.material(box).stress_constants_c_m2.any() and box.polarisation[1] != "z":
                raise ValueError(f"boxes.{index}: a plate is poled along z; correct it, or use theory solid")


def solid_from(entry: Any, where: str, folder: Path = Path(), faces: Sequence[Any] = ()) -> Solid:
    """Return the checked table ``[solid]``; paths in it start from ``folder``. ``faces`` are those of ``[[contacts]]``.

    Raise ParameterError for what is missing, unknown or not valid.
    """
    table = dict(as_table(entry, "solid", where))
    if isinstance(table.get("mesh"), str):
        with located(f"{where}: solid.mesh"):
            table["mesh"] = mesh_file(folder / table["mesh"])
    else:
        require("mesh" not in table, f"{where}: solid.mesh", table.get("mesh"), "the path of a file")
    own = as_table(table.get("materials", {}), "solid.materials", where)
    table["materials"] = tuple(_card(card, name, where) for name, card in own.items())
    for name, kind in (("boxes", Box), ("electrodes", Electrode), ("supports", Support)):
        given = table.get(name, [])
        if not isinstance(given, list):
            raise ParameterError(f"{where}: solid.{name} must be one or more tables [[solid.{name}]].")
        table[name] = tuple(build(kind, item, f"solid.{name}.{index}", where) for index, item in enumerate(given))
    if "contact" in table:
        table["contact"] = build(Face, table["contact"], "solid.contact", where)
    check_keys(table, [name for name in Solid.model_fields if name != "faces"], where, "solid")
    others = (face and build(Face, face, f"contacts.{index}.face", where) for index, face in enumerate(faces))
    return build(Solid, {**table, "faces": tuple(others)}, "solid", where)


def _card(entry: Any, name: str, where: str) -> Card:
    path = f"solid.materials.{name}"
    table = {**as_table(entry, path, where), "name": name}
    for part, kind in (("compliance", Compliance), ("charge", Charge), ("permittivity", Permittivity)):
        if part in table:
            table[part] = build(kind, table[part], f"{path}.{part}", where)
    return build(Card, table, path, where)
