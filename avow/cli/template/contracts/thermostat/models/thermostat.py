"""The nodes as they run on the robot: inputs by name, outputs as a dictionary."""

from fractions import Fraction


def read(raw):
    return {"temperature": raw - Fraction(1, 2)}


def control(temperature):
    if temperature < 18:
        return {"mode": "heat"}
    if temperature <= 24:
        return {"mode": "idle"}
    return {"mode": "cool"}
