"""A client of the simulated module that reads and writes as the service does, without a network."""

from pathlib import Path
from typing import Any

from impactcell.fieldbus.cycles.decoding import capture_from_words, sample_counts
from impactcell.fieldbus.registers import RegisterMap, registers_crc32
from impactcell.records import Capture
from simulator.device import Device, Truth
from simulator.scenario import Scenario
from simulator.serving import read_register_map

MAP = read_register_map(Path(__file__).parents[1] / "config" / "maps" / "fpga-v1.yaml")
SENSORS = {
    "force": {"rate_hz": 10000, "noise_std": 0.4, "longest_s": 0.2},
    "position": {"rate_hz": 10000, "noise_std": 1.5e-6, "longest_s": 0.3},
}


def scenario(**changed: Any) -> Scenario:
    content = {"format": 1, "register_map": "x", "strikes": {"period_s": 1.0}, "sensors": SENSORS}
    return Scenario.model_validate(content | changed)


def positioning(**changed: Any) -> Scenario:
    return scenario(strikes=None, positioning={"directions": [1, -1]}, **changed)


class Client:
    """Reads and writes as the service does, without a network."""

    def __init__(self, made: Scenario, registers: RegisterMap = MAP, **options: Any) -> None:
        self.truth: list[Truth] = []
        self.registers = registers
        self.faults: list[str] = []
        self.device = Device(made, registers, on_truth=self.truth.append, **options)

    def get(self, name: str) -> Any:
        register = self.registers[name]
        return register.decode(self.device.read("holding", register.address, register.words))

    def put(self, name: str, value: Any) -> None:
        register = self.registers[name]
        self.device.write(register.address, register.encode(value))

    def command(
        self, sequence: int, velocity: float = 0.05, stroke: float = 0.0015, direction: int = 1
    ) -> None:
        self.put("command_velocity", velocity)
        self.put("command_stroke", stroke)
        self.put("command_direction", direction)
        self.put("command_sequence", sequence)

    def read_slot(self, slot: int) -> Capture:
        self.put("slot_select", slot)
        header = {register.name: self.get(register.name) for register in self.registers.header()}
        counts = sample_counts(self.registers, header)
        samples = {}
        for name, count in counts.items():
            register = self.registers[name]
            words = count * register.words_per_value
            samples[name] = self.device.read("holding", register.address, words)
        first = self.registers["window_slot"].address
        last = self.registers["capture_crc32"].address
        words = self.device.read("holding", first, last - first)
        assert header["capture_crc32"] == registers_crc32(words, *samples.values())
        assert header["window_sequence"] == self.get("window_sequence_after")
        assert header["window_sequence"] % 2 == 0
        got, self.faults = capture_from_words(self.registers, header, samples)
        return got
