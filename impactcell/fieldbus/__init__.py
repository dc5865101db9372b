"""Modbus TCP: register map, codec, transport and acquisition of whole cycles."""
