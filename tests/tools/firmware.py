# SPDX-License-Identifier: GPL-3.0-or-later
"""Firmware on a microcontroller: the same samples on this computer and on a Cortex-M4 in qemu (``make firmware``)."""

import re
import subprocess
from pathlib import Path

import pytest

from tests.examples.test_firmware import DEFINED, FLAGS, FOLDER, built, replayed

TARGET = ["-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "--specs=rdimon.specs"]
MACHINE = [
    "qemu-system-arm", "-M", "mps2-an386", "-nographic", "-monitor", "none", "-serial", "none",
    "-semihosting-config", "enable=on,target=native", "-icount", "shift=10", "-kernel",
]  # fmt: skip
MOST_INSTRUCTIONS = 200  # of a step: 1.2 us at 170 MHz, if an instruction takes a cycle
MOST_BYTES = 1024  # of the firmware's code and constants


def test_a_cortex_m4_sets_and_logs_the_same_bits_as_this_computer(tmp_path: Path) -> None:
    library, program = built(tmp_path)
    found = DEFINED["run"](library, 0.2)
    image = tmp_path / "firmware.elf"
    sources = [FOLDER / name for name in ("replay.c", "speed_loop.c", "startup.c")]
    link = ["-T", FOLDER / "mps2.ld", "-o", image, *sources]
    subprocess.run(["arm-none-eabi-gcc", *FLAGS, *TARGET, *link], check=True, timeout=60)
    here, _ = replayed(found, [program], tmp_path)
    there, said = replayed(found, [*MACHINE, image], tmp_path)
    assert len(here) > 0
    assert there == here
    mean, most = (float(re.search(rf"instructions_{name} (\S+)", said)[1]) for name in ("mean", "most"))  # type: ignore[index]
    assert 10.0 < mean <= most < MOST_INSTRUCTIONS
    print(said)


def test_the_firmware_is_small(tmp_path: Path) -> None:
    image = tmp_path / "speed_loop.o"
    subprocess.run(
        ["arm-none-eabi-gcc", *FLAGS, *TARGET[:-1], "-c", "-o", image, FOLDER / "speed_loop.c"], check=True, timeout=60
    )
    said = subprocess.run(["arm-none-eabi-size", image], check=True, timeout=60, capture_output=True, text=True).stdout
    text, data, bss = map(int, said.splitlines()[1].split()[:3])
    print(said)
    assert 100 < text < MOST_BYTES
    assert data + bss == pytest.approx(16, abs=64)
