"""A cell that has its model file to itself."""

CELL = """
format: 1
cell: own
module: {{host: 127.0.0.1, port: 5020, register_map: {maps}/fpga-v1.yaml}}
model: model.yaml
part: {{mass_kg: 18.9}}
actuator: {{stroke_mm: 1.5}}
alarms: {{wear_limit: 0.25}}
opcua: {{users_file: users.yaml}}
"""
"""`maps` is the directory of register maps."""
